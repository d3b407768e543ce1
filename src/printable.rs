//! Text out of files as it may stand in a message.

/// Returns the text on one line: a replacement character stands for each control character, with which a file could break a message in two or command
/// a terminal.
pub(crate) fn printable(text: &str) -> String {
    let shown = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    text.chars().map(shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_do_not_reach_a_message() {
        assert_eq!(
            printable("wände `a`\n\u{1b}[31m\0"),
            "wände `a`\u{fffd}\u{fffd}[31m\u{fffd}"
        );
    }
}
