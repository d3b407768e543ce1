//! Formats text from files for messages.

/// Returns the text on one line, without control characters.
///
/// A replacement character replaces each character that breaks a line, controls a terminal or changes the direction of writing.
pub(crate) fn printable(text: &str) -> String {
    let shown = |c: char| if is_shown(c) { c } else { char::REPLACEMENT_CHARACTER };
    text.chars().map(shown).collect()
}

/// The greatest number of characters of input that a message quotes.
const MAX_QUOTED: usize = 60;

/// Returns input as a message quotes it: like [`printable`], cut after 60 characters.
pub(crate) fn quoted(text: &str) -> String {
    let mut characters = text.chars();
    let mut start: String = characters.by_ref().take(MAX_QUOTED).collect();
    if characters.next().is_some() {
        start.push('…');
    }
    printable(&start)
}

/// Returns a message like [`printable`], with each part in backticks cut as by [`quoted`].
pub(crate) fn printable_message(message: &str) -> String {
    let mut parts: Vec<String> = message.split('`').map(printable).collect();
    let n = parts.len();
    // The parts between an opening backtick and its end, which must exist.
    for part in parts.iter_mut().take(n.saturating_sub(1)).skip(1).step_by(2) {
        *part = quoted(part);
    }
    parts.join("`")
}

fn is_shown(c: char) -> bool {
    !c.is_control() && !matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Returns a number with the noun that it counts, in the plural (s, or es after s and ch) unless the number is 1.
pub(crate) fn counted(n: usize, noun: &str) -> String {
    let ending = match (n, noun.ends_with('s') || noun.ends_with("ch")) {
        (1, _) => "",
        (_, true) => "es",
        (_, false) => "s",
    };
    format!("{n} {noun}{ending}")
}

/// Returns a positive number with all its digits, in powers of ten if it would be mostly zeros.
pub(crate) fn short(value: f64) -> String {
    if (1e-4..1e6).contains(&value) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_are_in_powers_of_ten() {
        assert_eq!(
            [0.02, 1e-4, 2.5e-7, 1e-300].map(short),
            ["0.02", "0.0001", "2.5e-7", "1e-300"]
        );
    }

    #[test]
    fn one_thing_is_singular() {
        assert_eq!(
            [0, 1, 2].map(|n| counted(n, "frame")),
            ["0 frames", "1 frame", "2 frames"]
        );
        assert_eq!([1, 2].map(|n| counted(n, "pass")), ["1 pass", "2 passes"]);
    }

    #[test]
    fn quoted_input_is_cut() {
        let long = "ä".repeat(61);
        let cut = format!("{}…", "ä".repeat(60));
        assert_eq!((quoted(&long), quoted(&long[2..])), (cut.clone(), long[2..].to_owned()));
        assert_eq!(
            printable_message(&format!("{long} `{long}` {long} `b`")),
            format!("{long} `{cut}` {long} `b`")
        );
        assert_eq!(printable_message(&format!("it`s {long}")), format!("it`s {long}"));
        assert_eq!(quoted("a\nb"), "a\u{fffd}b");
    }

    #[test]
    fn control_characters_do_not_reach_a_message() {
        assert_eq!(
            printable("wände `a`\n\u{1b}[31m\0"),
            "wände `a`\u{fffd}\u{fffd}[31m\u{fffd}"
        );
    }
}
