//! Results of chunks in messages of limited length.

/// The most bytes of a message: a count of MPI has 31 bits.
const MAX_MESSAGE: usize = 1 << 30;

/// The bytes at the end of a part of a result: task, chunk, and whether more follow.
const TRAILER: usize = 24;

/// Cuts a result into messages.
pub(super) fn parts(work: u64, chunk: u64, mut result: Vec<u8>) -> Vec<Vec<u8>> {
    let mut parts = Vec::new();
    loop {
        let rest = result.split_off(result.len().min(MAX_MESSAGE));
        let more = u64::from(!rest.is_empty());
        for number in [work, chunk, more] {
            result.extend(number.to_le_bytes());
        }
        parts.push(result);
        if more == 0 {
            return parts;
        }
        result = rest;
    }
}

/// Removes the trailer of [`parts`] from the end of a message, and returns it.
pub(super) fn trailer(part: &mut Vec<u8>) -> Option<[u64; 3]> {
    let numbers = part.split_off(part.len().checked_sub(TRAILER)?);
    let (numbers, []) = numbers.as_chunks::<8>() else {
        return None;
    };
    <[[u8; 8]; 3]>::try_from(numbers)
        .ok()
        .map(|numbers| numbers.map(u64::from_le_bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_comes_back_from_its_parts() {
        for n in [0, 1, 100] {
            let result: Vec<u8> = (0..n).collect();
            let [part] = &mut parts(7, 9, result.clone())[..] else {
                panic!("one part");
            };
            assert_eq!(trailer(part), Some([7, 9, 0]));
            assert_eq!(*part, result);
        }
        assert_eq!(trailer(&mut vec![0; TRAILER - 1]), None);
    }
}
