#!/usr/bin/env bash
# Installs what radiosity is built with: Embree >= 4 with its headers, libclang (for bindgen) and a
# C compiler. Says nothing and changes nothing when all three are there.
#
# With --mpi also MPICH, for the Cargo feature `mpi`, unless an MPI library is there already.
#
# Embree comes from the distribution where it has version 4 (Debian 13, Ubuntu 24.04 and later).
# Debian 12 has only version 3: there, Debian 13's build of the library (Apache-2.0) is fetched,
# patched to run on Debian 12's C and C++ libraries, and put under /usr/local:
#   /usr/local/include/embree4/
#   /usr/local/lib/x86_64-linux-gnu/{libembree4.so,libembree4.so.4,libe4compat.so}
# Removing these (and running ldconfig) undoes it; no package of the system is replaced.
set -euo pipefail
umask 022
export LC_ALL=C

say() { echo "setup: $*"; }
die() { echo "setup: $*" >&2; exit 1; }

with_mpi=no
for flag; do
  case $flag in
    --mpi) with_mpi=yes ;;
    *) die "there is no flag $flag; there is --mpi." ;;
  esac
done

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

# Runs a command without its output, and shows that only if the command fails.
# Arguments: what it does, the command.
quietly() {
  local what=$1
  shift
  "$@" >"$tmp/log" 2>&1 </dev/null || { cat "$tmp/log" >&2; die "failed at $what."; }
}

# ---- what is there ----------------------------------------------------------------------------

cc_works() {
  echo 'int main(void) { return 0; }' | cc -x c - -o "$tmp/empty" 2>/dev/null
}

# libclang, and the headers that it brings along, in the places where bindgen and libclang look.
libclang_there() {
  local dir library=no headers=no
  for dir in "${LIBCLANG_PATH:-/usr/lib}" /usr/lib /usr/lib64 /usr/local/lib /usr/lib/*-linux-gnu /usr/lib/llvm-*/lib; do
    if exists "$dir"/libclang.so* "$dir"/libclang-[0-9]*.so*; then library=yes; fi
    if exists "$dir"/clang/*/include/stddef.h; then headers=yes; fi
  done
  [ $library$headers = yesyes ]
}

exists() {
  local file
  for file; do
    if [ -e "$file" ]; then return; fi
  done
  return 1
}

# Builds and runs a program that traces one ray. Prints Embree's version.
# Arguments: more options for the compiler.
embree_version() {
  cc "$@" -x c - -x none -lembree4 -lm -o "$tmp/trace" 2>"$tmp/trace.err" <<'C' && "$tmp/trace" 2>>"$tmp/trace.err"
#include <embree4/rtcore.h>
#include <stdio.h>

#if RTC_VERSION_MAJOR < 4
#error "Embree 4 or later is needed"
#endif

int main(void) {
  RTCDevice device = rtcNewDevice("threads=1");
  if (!device || rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION) != RTC_VERSION) {
    fputs("the library and the headers are of different versions\n", stderr);
    return 1;
  }
  RTCScene scene = rtcNewScene(device);
  RTCGeometry triangle = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  float *v = rtcSetNewGeometryBuffer(triangle, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3);
  unsigned *i = rtcSetNewGeometryBuffer(triangle, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 1);
  const float corners[9] = {0, 0, 2, 1, 0, 2, 0, 1, 2};
  for (int k = 0; k < 9; k++) v[k] = corners[k];
  for (int k = 0; k < 3; k++) i[k] = k;
  rtcCommitGeometry(triangle);
  rtcAttachGeometry(scene, triangle);
  rtcCommitScene(scene);

  struct RTCRayHit query = {
      .ray = {.org_x = 0.25f, .org_y = 0.25f, .dir_z = 1, .tfar = 10, .mask = -1},
      .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID},
  };
  rtcIntersect1(scene, &query, NULL);
  if (query.hit.primID != 0 || query.ray.tfar < 1.99f || query.ray.tfar > 2.01f) {
    fputs("a ray missed the triangle in front of it\n", stderr);
    return 1;
  }
  puts(RTC_VERSION_STRING);
  return 0;
}
C
}

# An MPI library with its headers, and what starts ranks.
mpi_there() {
  command -v mpirun >/dev/null && command -v mpicc >/dev/null &&
    printf '#include <mpi.h>\nint main(void) { return MPI_VERSION < 3; }\n' | mpicc -x c - -o "$tmp/mpi" 2>/dev/null
}

mpi_wanted() { [ $with_mpi = yes ] && ! mpi_there; }

if cc_works && libclang_there && embree_version >/dev/null && ! mpi_wanted; then exit 0; fi

# ---- what to install --------------------------------------------------------------------------

needs="Embree >= 4 with its headers (embree4/rtcore.h), libclang and a C compiler"
command -v apt-get >/dev/null || die "radiosity needs $needs: please install them, and run this again."

as_root=()
if [ "$(id -u)" != 0 ]; then
  command -v sudo >/dev/null || die "neither root nor sudo: have $needs installed, or run this as root."
  as_root=(sudo)
fi
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300)

say "updating apt's package lists"
quietly "updating apt's package lists" "${apt[@]}" update

# shellcheck disable=SC1091
os=$(. /etc/os-release && echo "${ID:-} ${VERSION_CODENAME:-}")
arch=$(dpkg --print-architecture)
packages=()
from_debian_13=no
if ! cc_works || ! command -v g++ >/dev/null; then packages+=(g++); fi # it brings cc
libclang_there || packages+=(libclang-dev)
if mpi_wanted; then packages+=(mpich libmpich-dev); fi
if ! embree_version >/dev/null; then
  offered=$(apt-cache policy libembree-dev | sed -n 's/^ *Candidate: \([0-9]\)/\1/p')
  if dpkg --compare-versions "${offered:-0}" ge 4; then
    packages+=(libembree-dev)
  elif [ "$os" != "debian bookworm" ]; then
    die "apt offers no Embree 4 here (does apt-get update succeed?): please install $needs, and run this again."
  elif [ "$arch" != amd64 ]; then
    die "on Debian 12, this script can bring Embree 4 to amd64 only, not to $arch: please install $needs, and run this again."
  else
    # TBB is what Embree runs on. The keyring's current version also holds Debian 13's keys.
    packages+=(libtbb12 debian-archive-keyring)
    from_debian_13=yes
  fi
fi
if [ ${#packages[@]} -gt 0 ]; then
  say "installing ${packages[*]}"
  quietly "installing ${packages[*]}" "${apt[@]}" install -y --no-install-recommends "${packages[@]}"
fi

# ---- Debian 12: Debian 13's Embree, patched -----------------------------------------------------

# Downloads Debian 13's packages of Embree and unpacks them in $tmp/unpacked. apt works in a state of its
# own, so that the system learns of no foreign packages, and checks the signatures as always.
fetch_embree() {
  local mirror deb
  # shellcheck disable=SC2016
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Origin: Debian' 'Codename: bookworm' 'Created-By: Packages' | sed -n 1p)
  [ -n "$mirror" ] || die "apt knows no mirror of Debian 12 (does apt-get update succeed?) to take Debian 13's Embree from."
  mkdir -p "$tmp"/{apt/sources,apt/lists/partial,apt/cache,debs,unpacked}
  cat >"$tmp/apt/sources/trixie.sources" <<EOF
Types: deb
URIs: $mirror
Suites: trixie
Components: main
Architectures: amd64
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg
EOF
  local private=(apt-get -q
    -o Dir::Etc::SourceList=/dev/null -o Dir::Etc::SourceParts="$tmp/apt/sources"
    -o Dir::Etc::Preferences=/dev/null -o Dir::Etc::PreferencesParts=/dev/null
    -o Dir::State::Lists="$tmp/apt/lists" -o Dir::State::Status=/dev/null -o Dir::Cache="$tmp/apt/cache"
    -o APT::Get::AllowUnauthenticated=false -o Acquire::AllowInsecureRepositories=false
    -o APT::Update::Error-Mode=any -o Acquire::Languages=none)
  if [ "$(id -u)" = 0 ]; then # then apt downloads as its own user
    chmod 755 "$tmp"
    chown _apt "$tmp/debs"
  fi
  quietly "fetching Debian 13's package lists" "${private[@]}" update
  (cd "$tmp/debs" && quietly "fetching Debian 13's Embree" "${private[@]}" download libembree4-4 libembree-dev)
  for deb in "$tmp"/debs/*.deb; do dpkg -x "$deb" "$tmp/unpacked"; done
}

# The three symbols that Debian 13's Embree takes from C and C++ libraries newer than Debian 12's.
build_compat() {
  g++ -O2 -fPIC -shared -Wl,-soname,libe4compat.so -x c++ - -o "$1" <<'CPP'
#include <cstdlib>
#include <exception>
#include <ios>

// What std::ios_base_library_init stands for: cin, cout and their like exist from here on.
static std::ios_base::Init streams;

extern "C" {
void _ZSt21ios_base_library_initv() {}

long __isoc23_strtol(const char *text, char **end, int base) { return std::strtol(text, end, base); }

void *__cxa_begin_catch(void *exception) noexcept;

[[noreturn]] void __cxa_call_terminate(void *exception) noexcept {
  if (exception) __cxa_begin_catch(exception);
  std::terminate();
}
}
CPP
}

# Makes the library find these symbols in libe4compat.so: lifts the requirement of the three versions
# that they have in newer system libraries, and adds libe4compat.so to the libraries it needs. All
# is changed in place. Stops if the library is not the one this was made for. Arguments: from, to.
patch_embree() {
  perl - "$@" <<'PERL'
use strict;
use warnings;

my ($from, $to) = @ARGV;
my $compat = 'libe4compat.so';
my %symbol_of = (    # version: [a version of the same library that Debian 12 has, the only symbol]
    'GLIBC_2.38'     => ['GLIBC_2.34',  '__isoc23_strtol'],
    'GLIBCXX_3.4.32' => ['GLIBCXX_3.4', '_ZSt21ios_base_library_initv'],
    'CXXABI_1.3.15'  => ['CXXABI_1.3',  '__cxa_call_terminate'],
);

open my $in, '<:raw', $from or die "$from: $!\n";
my $elf = do { local $/; <$in> };
$elf =~ /^\x7fELF\x02\x01/ or die "not a little-endian 64-bit ELF file\n";

# The sections' types tell what they are: offset, size and linked section of each.
my ($headers, $count) = unpack 'x40 Q< x12 S<', $elf;
my @sections = map { [unpack 'x4 L< x16 Q< Q< L<', substr $elf, $headers + 64 * $_, 64] } 0 .. $count - 1;
my ($dynamic, $symbols, $versions, $needs) = map {
    my $type = $_;
    my @found = grep { $_->[0] == $type } @sections;
    @found == 1 or die "no single section of type $type\n";
    $found[0];
} 6, 11, 0x6fffffff, 0x6ffffffe;
my $strings = $sections[$symbols->[3]][1];
my %used;    # offsets in the string table
sub text { my ($offset) = @_; $used{$offset} = 1; unpack "x$strings x$offset Z*", $elf }

# The versions that the library needs: position of the entry, and the index that symbols refer to.
my (%need, $library, $entry);
for ($library = $needs->[1];;) {
    my ($n, $first, $next) = unpack "x$library x2 S< x4 L< L<", $elf;
    for ($entry = $library + $first; $n--;) {
        my ($index, $name, $skip) = unpack "x$entry x6 S< L< L<", $elf;
        $need{text($name)} = [$entry, $index, $name];
        $entry += $skip;
    }
    last unless $next;
    $library += $next;
}

# The symbols: name and version index of each.
my %bound;
for my $i (0 .. $symbols->[2] / 24 - 1) {
    my $name  = text(unpack 'L<', substr $elf, $symbols->[1] + 24 * $i, 4);
    my $index = unpack 'S<', substr $elf, $versions->[1] + 2 * $i, 2;
    push @{$bound{$index & 0x7fff}}, [$name, $i];
}

for my $version (sort keys %symbol_of) {
    my ($older, $symbol) = @{$symbol_of{$version}};
    my ($new, $old) = @need{$version, $older};
    $new && $old or die "needs no $version, or no $older\n";
    my @found = @{$bound{$new->[1]} || []};
    "@{[map { $_->[0] } @found]}" eq $symbol or die "$version is not needed for $symbol alone\n";

    # Hash and name of the older version, the symbol's version "any" (1).
    substr($elf, $new->[0],     4) = substr $elf, $old->[0],     4;
    substr($elf, $new->[0] + 8, 4) = substr $elf, $old->[0] + 8, 4;
    substr($elf, $versions->[1] + 2 * $found[0][1], 2) = pack 'S<', 1;
}

# One more needed library, in the place of the (first) end mark, which another must follow. Its name
# takes the place of a version's that is no longer referred to.
my $end = 0;
while (1) {
    my ($tag, $value) = unpack 'Q< Q<', substr $elf, $dynamic->[1] + 16 * $end, 16;
    last if $tag == 0;
    text($value) if $tag == 1 || $tag == 14 || $tag == 15 || $tag == 29;
    $end++;
}
16 * ($end + 2) <= $dynamic->[2] && substr($elf, $dynamic->[1] + 16 * $end, 32) eq "\0" x 32
    or die "no room for one more needed library\n";
my $room = $need{'GLIBCXX_3.4.32'}[2];
length $compat <= length 'GLIBCXX_3.4.32' && !grep { $used{$room + $_} } 1 .. length $compat
    or die "no room for the name $compat\n";
substr($elf, $strings + $room, length($compat) + 1) = "$compat\0";
substr($elf, $dynamic->[1] + 16 * $end, 16) = pack 'Q< Q<', 1, $room;

open my $out, '>:raw', $to or die "$to: $!\n";
print $out $elf and close $out or die "$to: $!\n";
PERL
}

if [ $from_debian_13 = yes ]; then
  say "fetching Debian 13's Embree (Debian 12 offers no version 4)"
  fetch_embree

  say "patching it to run on Debian 12"
  mkdir "$tmp/lib"
  build_compat "$tmp/lib/libe4compat.so"
  patch_embree "$tmp/unpacked/usr/lib/x86_64-linux-gnu/libembree4.so.4" "$tmp/lib/libembree4.so.4" ||
    die "Debian 13's Embree is not what this script knows to patch; nothing was installed."
  ln -s libembree4.so.4 "$tmp/lib/libembree4.so"
  version=$(LD_LIBRARY_PATH="$tmp/lib" embree_version -I "$tmp/unpacked/usr/include" -L "$tmp/lib") ||
    { cat "$tmp/trace.err" >&2; die "the patched Embree does not work here; nothing was installed."; }

  # The link that programs are linked through comes last: without it, this script starts again.
  # The prefix for what the system's packages do not own; build.rs looks there too.
  prefix=/usr/local
  say "installing Embree $version under $prefix"
  lib=$prefix/lib/x86_64-linux-gnu
  "${as_root[@]}" install -D -m 644 -t $prefix/include/embree4 "$tmp"/unpacked/usr/include/embree4/*.h
  "${as_root[@]}" install -D -m 644 -t $lib "$tmp"/lib/lib{e4compat.so,embree4.so.4}
  "${as_root[@]}" ln -sf libembree4.so.4 $lib/libembree4.so
  "${as_root[@]}" /sbin/ldconfig
fi

# ---- and does it work? --------------------------------------------------------------------------

cc_works || die "the C compiler (cc) does not work."
libclang_there || die "libclang is still not where bindgen looks for it."
version=$(embree_version) || { cat "$tmp/trace.err" >&2; die "Embree still does not work."; }
if mpi_wanted; then die "MPI (mpirun, mpicc) still does not work."; fi
say "all is there (Embree $version)"
