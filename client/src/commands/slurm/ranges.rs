//! The language of `sbatch --array=`: `1-7,9,12-20:2`.

/// Indexes of one array job, and what is added to an index to get its frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Chunk {
    pub(super) shift: i64,
    pub(super) indexes: Vec<i64>,
}

/// Ascending numbers as ranges, as few as a look from left to right finds.
pub(super) fn compress(numbers: &[i64]) -> String {
    let mut ranges = Vec::new();
    let mut rest = numbers;
    while let Some((first, last, step, count)) = run(rest) {
        ranges.push(match (count, step) {
            (1, _) => first.to_string(),
            (_, 1) => format!("{first}-{last}"),
            _ => format!("{first}-{last}:{step}"),
        });
        rest = &rest[count..];
    }
    ranges.join(",")
}

/// First, last, step and length of what becomes one range at the beginning.
fn run(numbers: &[i64]) -> Option<(i64, i64, i64, usize)> {
    let first = *numbers.first()?;
    let step = numbers.get(1).map_or(1, |second| second - first);
    let even = numbers.windows(2).take_while(|pair| pair[1] - pair[0] == step).count() + 1;
    // Two numbers with a gap stay single: the second may begin a longer range.
    let count = if even == 2 && step > 1 { 1 } else { even };
    Some((first, numbers[count - 1], step, count))
}

/// Cuts ascending frames into arrays with indexes from 0 to `limit` - 1; frames that fit are their own indexes.
pub(super) fn chunks(frames: &[i64], limit: i64) -> Vec<Chunk> {
    let fits = |frame: &i64| (0..limit).contains(frame);
    if frames.iter().all(fits) {
        let whole = Chunk { shift: 0, indexes: frames.to_vec() };
        return if frames.is_empty() { Vec::new() } else { vec![whole] };
    }
    let mut list: Vec<Chunk> = Vec::new();
    for frame in frames {
        match list.last_mut() {
            Some(chunk) if frame - chunk.shift < limit => chunk.indexes.push(frame - chunk.shift),
            _ => list.push(Chunk { shift: *frame, indexes: vec![0] }),
        }
    }
    list
}

/// How many indexes a text such as `[3-9,12:2%4]` has; `None` when it is not in this language.
pub(super) fn count(text: &str) -> Option<u64> {
    let text = text.trim_matches(['[', ']']);
    let text = text.split_once('%').map_or(text, |(list, _)| list);
    text.split(',').map(count_range).sum()
}

fn count_range(range: &str) -> Option<u64> {
    let (range, step) = range.split_once(':').unwrap_or((range, "1"));
    let (first, last) = range.split_once('-').unwrap_or((range, range));
    let (first, last, step): (u64, u64, u64) =
        (first.parse().ok()?, last.parse().ok()?, step.parse().ok().filter(|step| *step > 0)?);
    Some(last.checked_sub(first)? / step + 1)
}

#[cfg(test)]
mod tests {
    use super::{Chunk, chunks, compress, count};

    #[test]
    fn ranges_are_short() {
        let some = [1, 2, 3, 4, 5, 6, 7, 9, 12, 14, 16, 18, 20];
        assert_eq!(compress(&some), "1-7,9,12-20:2");
        for (numbers, text) in [
            (&[][..], ""),
            (&[5], "5"),
            (&[5, 6], "5-6"),
            (&[5, 7], "5,7"),
            (&[5, 7, 9], "5-9:2"),
            (&[5, 7, 8, 9], "5,7-9"),
            (&[0, 10, 20, 21, 22, 40], "0-20:10,21-22,40"),
        ] {
            assert_eq!(compress(numbers), text);
            assert_eq!(count(text), (!text.is_empty()).then_some(numbers.len() as u64), "{text}");
        }
    }

    #[test]
    fn every_set_comes_back() {
        for bits in 0_u32..1 << 12 {
            let numbers: Vec<i64> = (0..12).filter(|at| bits & (1 << at) != 0).collect();
            let mut back = Vec::new();
            for range in compress(&numbers).split(',').filter(|range| !range.is_empty()) {
                let (range, step) = range.split_once(':').unwrap_or((range, "1"));
                let (first, last) = range.split_once('-').unwrap_or((range, range));
                let (first, last): (i64, i64) = (first.parse().unwrap(), last.parse().unwrap());
                back.extend((first..=last).step_by(step.parse().unwrap()));
            }
            assert_eq!(back, numbers);
        }
    }

    #[test]
    fn frames_that_slurm_has_no_index_for_are_shifted() {
        let chunk = |shift, indexes: &[i64]| Chunk { shift, indexes: indexes.to_vec() };
        assert_eq!(chunks(&[0, 5, 99], 100), [chunk(0, &[0, 5, 99])]);
        assert_eq!(chunks(&[5, 99, 100, 104, 105], 100), [chunk(5, &[0, 94, 95, 99]), chunk(105, &[0])]);
        assert_eq!(chunks(&[-3, -1, 2], 100), [chunk(-3, &[0, 2, 5])]);
        assert!(chunks(&[], 100).is_empty());
    }

    #[test]
    fn what_slurm_says_of_an_array_is_counted() {
        assert_eq!(count("6-7%6"), Some(2));
        assert_eq!(count("[1,3,5-9:2%4]"), Some(5));
        for wrong in ["", "a", "3-1", "1-5:0", "1,...", "1-2-3"] {
            assert_eq!(count(wrong), None, "{wrong}");
        }
    }
}
