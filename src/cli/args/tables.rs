//! Parses lists of tables.

use std::ops::RangeInclusive;

/// Reads a list like `3,5-7` of the tables that exist.
///
/// # Errors
/// The fault of the list, and the remedy.
pub(crate) fn parse_tables(list: &str, built: RangeInclusive<u8>) -> Result<Vec<u8>, String> {
    let (least, most) = (built.start(), built.end());
    let mut tables = Vec::new();
    for part in list.split(',') {
        let ends = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u8>().ok();
        let range = number(ends.0).zip(number(ends.1)).filter(|(a, b)| a <= b);
        let Some((first, last)) = range else {
            return Err(format!(
                "`{part}` names no tables; write --tables {least}-{most} or --tables {least},{most}"
            ));
        };
        if !(built.contains(&first) && built.contains(&last)) {
            return Err(format!(
                "`{part}`: of this paper tables {least} to {most} are built; write --tables {least}-{most}"
            ));
        }
        tables.extend(first..=last);
    }
    tables.sort_unstable();
    tables.dedup();
    Ok(tables)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_tables() {
        let read = |list: &str| parse_tables(list, 3..=8);
        assert_eq!(read("3-8"), Ok(vec![3, 4, 5, 6, 7, 8]));
        assert_eq!(read("7, 3,5-7"), Ok(vec![3, 5, 6, 7]));
        for wrong in ["", "2", "3-9", "8-3", "x", "3-"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
