//! The number of cases of the longer tests.

/// Returns how many cases a test takes: a few, or all where `ALL_CASES` is set, as CONTRIBUTING.md asks before a release.
pub(crate) fn n_cases<N>(few: N, all: N) -> N {
    if std::env::var_os("ALL_CASES").is_some() {
        all
    } else {
        few
    }
}
