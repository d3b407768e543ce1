#!/usr/bin/env bash
# Builds the manual into target/manual; open target/manual/docs/index.html.
#
# It needs mdBook: `apt-get install mdbook` where the distribution has it, else `cargo install mdbook`.
# MDBOOK=path names one that is not on the path.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mdbook=${MDBOOK:-mdbook}
if ! command -v "$mdbook" >/dev/null; then
    echo "docs/build.sh: there is no mdbook; install it with 'cargo install mdbook', and run this again" >&2
    exit 1
fi
"$mdbook" build docs
# Images and scripts that pages refer to.
cp --parents scenes/*/*.png scenes/*/*.toml python/examples/*.py target/manual/
# Links within the built book: a page that is missing is an error.
broken=0
while IFS=: read -r page link; do
    file=$(dirname "$page")/${link%%#*}
    [ -e "$file" ] || { echo "docs/build.sh: $page links to $link, which is not there" >&2; broken=1; }
done < <(grep -oE '(href|src)="[^"#:]+[^":]*"' -r target/manual/docs --include='*.html' | sed -E 's/(href|src)="([^"]*)"/\2/')
[ "$broken" -eq 0 ]
echo "wrote target/manual/docs/index.html"
