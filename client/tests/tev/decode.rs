//! tev's wire format read back, written from its description and not from what writes it.
//!
//! TCP, little-endian, no replies. A packet is a u32 with its total length, that number included, a u8 with its type, and
//! a body. A bool is one byte, strings end in NUL.
//! `CreateImage` (4): bool grab focus, name, i32 width, height, number of channels, names of the channels.
//! `UpdateImageV3` (6): bool grab focus, name, i32 number of channels, their names, i32 x, y, width, height, an i64 offset
//! for each channel, an i64 stride for each channel, f32 data; pixel p of a channel is data[offset + p * stride].

use std::collections::BTreeMap;
use std::io::Read;

/// One packet.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Packet {
    Create {
        focus: bool,
        name: String,
        width: usize,
        height: usize,
        channels: Vec<String>,
    },
    Update {
        focus: bool,
        name: String,
        corner: (usize, usize),
        size: (usize, usize),
        /// Values of each channel, row by row.
        planes: Vec<(String, Vec<f32>)>,
    },
}

/// The next packet and its bytes; nothing at the end of the stream, which must lie between two packets.
pub(crate) fn read(stream: &mut impl Read) -> Option<(Vec<u8>, Packet)> {
    let mut length = [0; 4];
    match stream.read(&mut length[..1]) {
        Ok(1) => stream.read_exact(&mut length[1..]).unwrap(),
        _ => return None,
    }
    let mut bytes = vec![0; u32::from_le_bytes(length) as usize];
    bytes[..4].copy_from_slice(&length);
    stream.read_exact(&mut bytes[4..]).expect("a whole packet");
    let packet = Body(&bytes[4..]).packet();
    Some((bytes, packet))
}

struct Body<'a>(&'a [u8]);

impl Body<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_at(N);
        self.0 = rest;
        head.try_into().unwrap()
    }

    fn flag(&mut self) -> bool {
        match self.take() {
            [0] => false,
            [1] => true,
            [other] => panic!("{other} is no bool"),
        }
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).expect("a string ends in NUL");
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }

    fn number(&mut self) -> usize {
        usize::try_from(i32::from_le_bytes(self.take())).expect("from 0")
    }

    fn long(&mut self) -> usize {
        usize::try_from(i64::from_le_bytes(self.take())).expect("from 0")
    }

    fn texts(&mut self) -> Vec<String> {
        (0..self.number()).map(|_| self.text()).collect()
    }

    fn packet(mut self) -> Packet {
        let kind = self.take::<1>()[0];
        let packet = match kind {
            4 => Packet::Create {
                focus: self.flag(),
                name: self.text(),
                width: self.number(),
                height: self.number(),
                channels: self.texts(),
            },
            6 => self.update(),
            other => panic!("packet type {other}"),
        };
        assert!(self.0.is_empty(), "{} bytes after the packet of type {kind}", self.0.len());
        packet
    }

    fn update(&mut self) -> Packet {
        let (focus, name, names) = (self.flag(), self.text(), self.texts());
        let (corner, size) = ((self.number(), self.number()), (self.number(), self.number()));
        let offsets: Vec<usize> = names.iter().map(|_| self.long()).collect();
        let strides: Vec<usize> = names.iter().map(|_| self.long()).collect();
        let data: Vec<f32> =
            self.0.chunks_exact(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
        self.0 = &self.0[4 * data.len()..];
        let pixels = size.0 * size.1;
        let plane =
            |channel: usize| (0..pixels).map(|p| data[offsets[channel] + p * strides[channel]]).collect();
        let last = (0..names.len()).map(|c| offsets[c] + (pixels - 1) * strides[c]).max().unwrap();
        assert_eq!(data.len(), last + 1, "no value is missing or too many");
        let planes = (0..names.len()).map(plane).collect::<Vec<_>>();
        Packet::Update { focus, name, corner, size, planes: names.into_iter().zip(planes).collect() }
    }
}

/// A picture as tev holds it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) channels: BTreeMap<String, Vec<f32>>,
    /// Updates in which each pixel of a channel was replaced, at most.
    pub(crate) updates: usize,
}

/// What tev shows: pictures by name.
#[derive(Debug, Default)]
pub(crate) struct Screen {
    pub(crate) pictures: BTreeMap<String, Picture>,
    /// Names in the order in which they came to the front.
    pub(crate) front: Vec<String>,
}

impl Screen {
    pub(crate) fn take(&mut self, packet: Packet) {
        match packet {
            Packet::Create { focus, name, width, height, channels } => {
                let black = vec![0.0; width * height];
                let channels = channels.into_iter().map(|channel| (channel, black.clone())).collect();
                let picture = Picture { width, height, channels, updates: 0 };
                assert!(self.pictures.insert(name.clone(), picture).is_none(), "{name} is opened once");
                if focus {
                    self.front.push(name);
                }
            }
            Packet::Update { focus, name, corner, size, planes } => {
                assert!(!focus, "a tile does not take the focus away from what one looks at");
                let picture = self.pictures.get_mut(&name).expect("a picture that is open");
                picture.updates += 1;
                assert!(corner.0 + size.0 <= picture.width && corner.1 + size.1 <= picture.height);
                for (channel, values) in planes {
                    let plane = picture.channels.get_mut(&channel).expect("a channel of the picture");
                    for (row, line) in values.chunks_exact(size.0).enumerate() {
                        let begin = (corner.1 + row) * picture.width + corner.0;
                        plane[begin..begin + size.0].copy_from_slice(line);
                    }
                }
            }
        }
    }
}
