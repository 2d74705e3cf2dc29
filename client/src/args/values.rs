//! The little languages of flag values: `1-250:2`, `640x360`, `0,0,64,64`.

use karst_core::film::Region;

/// Frame numbers first, first + step, … up to last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameList {
    pub(crate) first: i32,
    pub(crate) last: i32,
    pub(crate) step: u32,
}

impl FrameList {
    /// One frame.
    pub(crate) fn one(frame: i32) -> Self {
        Self { first: frame, last: frame, step: 1 }
    }

    /// The frame numbers in order.
    pub(crate) fn iter(self) -> impl Iterator<Item = i32> {
        (self.first..=self.last).step_by(self.step as usize)
    }

    /// Whether the list has this frame.
    pub(crate) fn contains(self, frame: i32) -> bool {
        frame >= self.first
            && frame <= self.last
            && (i64::from(frame) - i64::from(self.first)) % i64::from(self.step) == 0
    }
}

/// `7`, `1-250` or `1-250:2`; numbers may be negative.
pub(super) fn frames(text: &str) -> Result<FrameList, String> {
    let wrong = || "expected FRAME, FIRST-LAST or FIRST-LAST:STEP, first to last, step from 1".to_owned();
    let (range, step) = text.split_once(':').unwrap_or((text, "1"));
    // A minus sign in front belongs to the number.
    let dash = range.char_indices().skip(1).find(|(_, letter)| *letter == '-').map(|(at, _)| at);
    let (first, last) = dash.map_or((range, range), |at| (&range[..at], &range[at + 1..]));
    let list = FrameList {
        first: first.parse().map_err(|_| wrong())?,
        last: last.parse().map_err(|_| wrong())?,
        step: step.parse().map_err(|_| wrong())?,
    };
    if list.first > list.last || list.step == 0 { Err(wrong()) } else { Ok(list) }
}

/// `640x360`.
pub(super) fn size(text: &str) -> Result<(u32, u32), String> {
    let parsed =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    parsed
        .filter(|(width, height)| *width > 0 && *height > 0)
        .ok_or_else(|| "expected WIDTHxHEIGHT in pixels, both from 1, such as 640x360".to_owned())
}

/// `X,Y,WIDTH,HEIGHT`.
pub(super) fn crop(text: &str) -> Result<Region, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let region = match numbers.as_deref() {
        Some(&[x0, y0, width, height]) if width > 0 && height > 0 => {
            x0.checked_add(width).zip(y0.checked_add(height)).map(|(x1, y1)| Region { x0, y0, x1, y1 })
        }
        _ => None,
    };
    region.ok_or_else(|| "expected X,Y,WIDTH,HEIGHT in pixels, width and height from 1".to_owned())
}

/// A multiple of 16 from 16 to 256.
pub(super) fn tile_size(text: &str) -> Result<u32, String> {
    text.parse()
        .ok()
        .filter(|edge| (16..=256).contains(edge) && edge % 16 == 0)
        .ok_or_else(|| "expected a multiple of 16 from 16 to 256".to_owned())
}

/// A host and a port.
pub(super) fn address(text: &str) -> Result<String, String> {
    text.rsplit_once(':')
        .filter(|(host, port)| !host.is_empty() && port.parse().is_ok_and(|port: u16| port > 0))
        .map(|_| text.to_owned())
        .ok_or_else(|| "expected HOST:PORT, such as 127.0.0.1:14158".to_owned())
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|number: &f64| number.is_finite() && *number > 0.0)
        .ok_or_else(|| "expected a finite number above 0".to_owned())
}

/// An exposure, -64 to 64.
pub(super) fn stops(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|stops: &f32| (-64.0..=64.0).contains(stops))
        .ok_or_else(|| "expected a number of stops from -64 to 64".to_owned())
}

#[cfg(test)]
mod tests {
    use super::{FrameList, address, crop, frames, size, stops};
    use karst_core::film::Region;

    #[test]
    fn frame_lists() {
        let list = |first, last, step| Ok(FrameList { first, last, step });
        assert_eq!(frames("7"), list(7, 7, 1));
        assert_eq!(frames("1-250:2"), list(1, 250, 2));
        assert_eq!(frames("-5--1"), list(-5, -1, 1));
        assert_eq!(frames("-5-3:4"), list(-5, 3, 4));
        for wrong in ["", "-", "a", "1-", "5-1", "1-2:0", "1-2:", "1:2:3", "1-2-3", "99999999999"] {
            assert!(frames(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn a_list_knows_its_frames() {
        let list = frames("-5-3:4").unwrap();
        assert_eq!(list.iter().collect::<Vec<_>>(), [-5, -1, 3]);
        assert!(list.contains(-1) && !list.contains(0) && !list.contains(7));
        assert!(frames("-2147483648-2147483647").unwrap().contains(0));
    }

    #[test]
    fn addresses() {
        for right in ["127.0.0.1:14158", "[::1]:1", "desk.example:65535"] {
            assert_eq!(address(right).as_deref(), Ok(right));
        }
        for wrong in ["", "host", ":1", "host:", "host:0", "host:65536", "14158"] {
            assert!(address(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn sizes_and_crops() {
        assert_eq!(size("640x360"), Ok((640, 360)));
        for wrong in ["640", "0x1", "1x0", "-1x2", "1x2x3", "x"] {
            assert!(size(wrong).is_err(), "{wrong:?}");
        }
        assert_eq!(crop("8, 16,4,2"), Ok(Region { x0: 8, y0: 16, x1: 12, y1: 18 }));
        for wrong in ["1,2,3", "0,0,0,1", "4294967295,0,1,1", "0,0,-1,1", "1,2,3,4,5"] {
            assert!(crop(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn exposures() {
        assert_eq!((stops("-2.5"), stops("64")), (Ok(-2.5), Ok(64.0)));
        assert!(["65", "inf", "nan", "a stop", ""].into_iter().all(|text| stops(text).is_err()));
    }
}
