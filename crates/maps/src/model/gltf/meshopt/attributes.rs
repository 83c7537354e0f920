//! Codec of attributes (`KHR_meshopt_compression`, appendix A, mode 0), versions 0 and 1.
//!
//! Elements come in blocks. In a block each byte of an element has its deltas beside one another, in groups
//! of sixteen that are packed alike; four bytes are a channel, whose deltas are undone together.

use super::stream::{Damage, Stream, TRUNCATED, UNKNOWN, unzigzag};

/// Elements of a group.
const GROUP: usize = 16;

/// Most elements of a block.
const MAX_BLOCK: usize = 256;

/// Most bytes that a byte of the stream stands for: a block of [`MAX_BLOCK`] elements has at least its
/// control header, two bits for each byte of an element, where all deltas are zero.
pub(super) const MAX_RATIO: usize = 4 * MAX_BLOCK;

/// Decodes `count` elements of `stride` bytes, a multiple of 4 up to 256.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Damage> {
    let mut stream = Stream(bytes);
    let (controlled, least_tail) = match stream.byte()? {
        0xA0 => (false, 32),
        0xA1 => (true, 24),
        _ => return Err(UNKNOWN),
    };
    let channels = stride / 4;
    let tail_size = if controlled { stride + channels } else { stride };
    let tail = stream.take_tail(tail_size.max(least_tail))?;
    let (first, modes) = tail[tail.len() - tail_size..].split_at(stride);
    let mut values = first.as_chunks::<4>().0.to_vec();
    let deltas = match controlled {
        true => modes.iter().map(|mode| Delta::of(*mode)).collect::<Result<Vec<_>, _>>()?,
        false => vec![Delta::Bytes; channels],
    };

    let block_elements = (8192 / stride / GROUP * GROUP).min(MAX_BLOCK);
    // A block has a control header, or more for the headers of its groups, so that memory is bounded by the
    // stream's length.
    if count.div_ceil(block_elements) > stream.0.len() / channels {
        return Err(TRUNCATED);
    }
    let mut decoded = vec![0; count * stride];
    for block in decoded.chunks_mut(block_elements * stride) {
        let elements = block.len() / stride;
        let control = if controlled { Some(stream.take(channels)?) } else { None };
        for (channel, value) in values.iter_mut().enumerate() {
            let mut lanes = [[0; MAX_BLOCK]; 4];
            for (i, lane) in lanes.iter_mut().enumerate() {
                match control.map(|control| control[channel] >> (2 * i) & 3) {
                    None => groups(&mut stream, [0, 2, 4, 8], elements, lane)?,
                    Some(0) => groups(&mut stream, [0, 1, 2, 4], elements, lane)?,
                    Some(1) => groups(&mut stream, [1, 2, 4, 8], elements, lane)?,
                    Some(2) => {}
                    Some(_) => lane[..elements].copy_from_slice(stream.take(elements)?),
                }
            }
            for (i, element) in block.chunks_exact_mut(stride).enumerate() {
                *value = deltas[channel].onto(*value, std::array::from_fn(|byte| lanes[byte][i]));
                element[4 * channel..][..4].copy_from_slice(value);
            }
        }
    }
    stream.end()?;
    Ok(decoded)
}

/// Reads a byte's codes of all elements: two bits for each group, which say by `widths` in how many bits its
/// codes are packed, then the groups. The last group is whole, whatever is needed of it.
fn groups(
    stream: &mut Stream<'_>,
    widths: [usize; 4],
    elements: usize,
    lane: &mut [u8; MAX_BLOCK],
) -> Result<(), Damage> {
    let count = elements.div_ceil(GROUP);
    let header = stream.take(count.div_ceil(4))?;
    for (i, group) in lane.as_chunks_mut().0.iter_mut().take(count).enumerate() {
        match widths[usize::from(header[i / 4] >> (2 * (i % 4)) & 3)] {
            0 => {}
            1 => packed::<1>(stream, group)?,
            2 => packed::<2>(stream, group)?,
            4 => packed::<4>(stream, group)?,
            _ => group.copy_from_slice(stream.take(GROUP)?),
        }
    }
    Ok(())
}

/// Reads a group's codes of `WIDTH` bits: single bits run up in a byte, wider ones down.
fn packed<const WIDTH: usize>(stream: &mut Stream<'_>, group: &mut [u8; GROUP]) -> Result<(), Damage> {
    let bytes = stream.take(GROUP * WIDTH / 8)?;
    // All bits set stands for a whole byte behind the packed ones.
    let escape = (1 << WIDTH) - 1;
    for (i, code) in group.iter_mut().enumerate() {
        let from_low = if WIDTH == 1 { i % 8 } else { 8 - WIDTH - i * WIDTH % 8 };
        *code = bytes[i * WIDTH / 8] >> from_low & escape;
        if *code == escape {
            *code = stream.byte()?;
        }
    }
    Ok(())
}

/// Difference of a channel's elements from those before.
#[derive(Clone, Copy)]
enum Delta {
    /// Zigzag codes of four differences of bytes.
    Bytes,
    /// Zigzag codes of two differences of 16 bits.
    Words,
    /// Exclusive or of 32 bits, which the encoder rotated to the left by this.
    Xor(u32),
}

impl Delta {
    /// Of a channel's mode in the tail: four bits, and four of the rotation.
    fn of(mode: u8) -> Result<Self, Damage> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, rotation) => Ok(Self::Xor(rotation.into())),
            _ => Err("has a channel of an unknown mode"),
        }
    }

    /// The element that comes after `before`, low bytes first.
    fn onto(self, before: [u8; 4], code: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|i| before[i].wrapping_add(unzigzag(code[i].into()) as u8)),
            Self::Words => {
                let word = |bytes: [u8; 4], i| u16::from_le_bytes([bytes[i], bytes[i + 1]]);
                let [low, high] =
                    [0, 2].map(|i| word(before, i).wrapping_add(unzigzag(word(code, i).into()) as u16));
                (u32::from(high) << 16 | u32::from(low)).to_le_bytes()
            }
            Self::Xor(rotation) => {
                (u32::from_le_bytes(before) ^ u32::from_le_bytes(code).rotate_right(rotation)).to_le_bytes()
            }
        }
    }
}
