//! Parses numbers of bytes.

/// Reads a number of bytes: `512MiB`, `2G`, `1.5GB`, or a plain number.
///
/// K, M, G and T count in 1024, as do KiB to TiB; KB to TB count in 1000.
pub(super) fn parse_byte(text: &str) -> Result<u64, String> {
    let trimmed = text.trim();
    let digits = trimmed
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(trimmed.len());
    let (number, unit) = trimmed.split_at(digits);
    let bad = || "give a number of bytes, as in 512MiB, 2G or 1500000000".to_owned();
    let number: f64 = number.parse().map_err(|_| bad())?;
    let factor = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kib" => 1024.0,
        "m" | "mib" => 1024.0 * 1024.0,
        "g" | "gib" => 1024.0 * 1024.0 * 1024.0,
        "t" | "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err(bad()),
    };
    let byte = number * factor;
    if !(1.0..=1e18).contains(&byte) {
        return Err(bad());
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and 1e18"
    )]
    Ok(byte as u64)
}

#[cfg(test)]
mod tests {
    use super::parse_byte;

    #[test]
    fn bytes_are_read_as_people_write_them() {
        for (text, byte) in [
            ("512MiB", 512 << 20),
            ("2G", 2 << 30),
            ("1.5k", 1536),
            ("3 kB", 3000),
            ("1500000000", 1_500_000_000),
            ("0.5gib", 1 << 29),
            ("7b", 7),
        ] {
            assert_eq!(parse_byte(text), Ok(byte), "{text}");
        }
        for text in ["", "G", "0", "-1", "1e9", "1.2.3M", "5 apples", "1000000T", "NaN"] {
            assert!(parse_byte(text).is_err(), "{text}");
        }
    }
}
