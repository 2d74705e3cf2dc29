//! Tells JPEG files that the decoder would read wrongly (ITU-T T.81, annex B).
//!
//! Baseline files may have a scan for each colour. zune-jpeg 0.5.15 makes other pixels of them, or panics
//! (etemesi254/zune-image, issues 422 and 361), where such files are whole as well as where they are damaged.

const SEPARATOR: u8 = 0xff;

/// Whether this is a baseline JPEG whose first scan has not all colours.
pub(super) fn has_separate_scans(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    let mut colors = None;
    // From marker to marker; what stands between them is skipped as decoders do.
    while let Some(at) =
        rest.windows(2).position(|pair| pair[0] == SEPARATOR && !matches!(pair[1], 0 | SEPARATOR))
    {
        let marker = rest[at + 1];
        let segment = &rest[at + 2..];
        let number = |index: usize| segment.get(index).copied();
        let length = match (number(0), number(1)) {
            (Some(high), Some(low)) => usize::from(u16::from_be_bytes([high, low])),
            _ => return false,
        };
        match marker {
            // Begin, restarts and others without a segment.
            0x01 | 0xd0..=0xd8 => {
                rest = segment;
                continue;
            }
            // Frames of the two kinds that are coded in one pass: length, precision, height, width, colours.
            0xc0 | 0xc1 => colors = number(7),
            // A scan: length, colours.
            0xda => return colors.is_some() && colors != number(2),
            _ => {}
        }
        let Some(next) = segment.get(length.max(2)..) else { return false };
        rest = next;
    }
    false
}
