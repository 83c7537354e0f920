//! Bytes of a compressed stream, read from the front.

/// Fault of a stream: the end of a sentence about it.
pub(super) type Damage = &'static str;

pub(super) const TRUNCATED: Damage = "ends too early";
pub(super) const UNKNOWN: Damage = "is of another mode or a later version";

/// The bytes not yet read.
pub(super) struct Stream<'a>(pub(super) &'a [u8]);

impl<'a> Stream<'a> {
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], Damage> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or(TRUNCATED)?;
        self.0 = rest;
        Ok(taken)
    }

    /// Cuts the last bytes off.
    pub(super) fn take_tail(&mut self, length: usize) -> Result<&'a [u8], Damage> {
        let at = self.0.len().checked_sub(length).ok_or(TRUNCATED)?;
        let (rest, tail) = self.0.split_at(at);
        self.0 = rest;
        Ok(tail)
    }

    pub(super) fn byte(&mut self) -> Result<u8, Damage> {
        let (byte, rest) = self.0.split_first().ok_or(TRUNCATED)?;
        self.0 = rest;
        Ok(*byte)
    }

    /// An integer of one to five bytes, seven bits each from the lowest up (unsigned LEB128).
    pub(super) fn varint(&mut self) -> Result<u32, Damage> {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("has an index of more than five bytes")
    }

    /// Nothing may be left between the data and the tail.
    pub(super) fn end(self) -> Result<(), Damage> {
        if self.0.is_empty() { Ok(()) } else { Err("has bytes left over") }
    }
}

/// The integer that a zigzag code stands for, modulo 2³²: 0, -1, 1, -2 and so on.
pub(super) const fn unzigzag(code: u32) -> u32 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}
