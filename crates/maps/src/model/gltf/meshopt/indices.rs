//! Codecs of indices (`KHR_meshopt_compression`, appendix A): triangles, mode 1, and sequences, mode 2.

use super::stream::{Damage, Stream, TRUNCATED, UNKNOWN, unzigzag};

/// The sixteen values that came last.
struct Recent<T> {
    values: [T; 16],
    pushed: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Self {
        Self { values: [T::default(); 16], pushed: 0 }
    }

    fn push(&mut self, value: T) {
        self.values[self.pushed % 16] = value;
        self.pushed += 1;
    }

    /// The value that was pushed `back` pushes before the last one.
    fn get(&self, back: u8) -> Result<T, Damage> {
        let at = self.pushed.checked_sub(1 + usize::from(back));
        at.map(|at| self.values[at % 16]).ok_or("names an edge or a vertex before the first")
    }
}

/// State of a decoder of triangles.
struct Triangles<'a> {
    data: Stream<'a>,
    /// Least index not used yet.
    next: u32,
    /// Index coded in full last.
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

/// Decodes `count` indices, three for each triangle.
pub(super) fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, Damage> {
    let mut data = Stream(bytes);
    if data.byte()? != 0xE1 {
        return Err(UNKNOWN);
    }
    let pairs = data.take_tail(16)?;
    if pairs.iter().any(|pair| pair & 15 == 15 || pair >> 4 == 15) || pairs[14..] != [0, 0] {
        return Err("has a damaged table");
    }
    // A code for each triangle, so that memory is bounded by the stream's length.
    let codes = data.take(count / 3)?;
    let mut state = Triangles { data, next: 0, last: 0, edges: Recent::new(), vertices: Recent::new() };
    let mut indices = Vec::with_capacity(count);
    for code in codes {
        indices.extend(match code >> 4 {
            15 => state.apart(code & 15, pairs)?,
            edge => state.beside(edge, code & 15)?,
        });
    }
    state.data.end()?;
    Ok(indices)
}

impl Triangles<'_> {
    fn next(&mut self) -> u32 {
        let next = self.next;
        self.next = next.wrapping_add(1);
        next
    }

    /// An index by its difference from the last such one.
    fn far(&mut self) -> Result<u32, Damage> {
        self.last = self.last.wrapping_add(unzigzag(self.data.varint()?));
        Ok(self.last)
    }

    /// A triangle on a recent edge.
    fn beside(&mut self, edge: u8, third: u8) -> Result<[u32; 3], Damage> {
        let [a, b] = self.edges.get(edge)?;
        let c = match third {
            0 => self.next(),
            1..13 => self.vertices.get(third)?,
            15 => self.far()?,
            _ => {
                self.last = if third == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                self.last
            }
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if !(1..13).contains(&third) {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle that shares no recent edge: a pair says where its second and third vertex come from, of the
    /// table or of the data.
    fn apart(&mut self, code: u8, pairs: &[u8]) -> Result<[u32; 3], Damage> {
        let pair = match code {
            14 | 15 => self.data.byte()?,
            _ => pairs[usize::from(code)],
        };
        if code >= 14 && pair == 0 {
            self.next = 0;
        }
        let a = if code == 15 { self.far()? } else { self.next() };
        let sources = [pair >> 4, pair & 15];
        let mut others = [0; 2];
        for (other, source) in others.iter_mut().zip(sources) {
            *other = match source {
                0 => self.next(),
                15 => self.far()?,
                recent => self.vertices.get(recent - 1)?,
            };
        }
        let [b, c] = others;
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(edge);
        }
        self.vertices.push(a);
        for (other, source) in others.into_iter().zip(sources) {
            if matches!(source, 0 | 15) {
                self.vertices.push(other);
            }
        }
        Ok([a, b, c])
    }
}

/// Decodes `count` indices, each by its difference from one of two before it.
pub(super) fn sequence(bytes: &[u8], count: usize) -> Result<Vec<u32>, Damage> {
    let mut data = Stream(bytes);
    if data.byte()? != 0xD1 {
        return Err(UNKNOWN);
    }
    data.take_tail(4)?;
    // An index has at least a byte, so that memory is bounded by the stream's length.
    if count > data.0.len() {
        return Err(TRUNCATED);
    }
    let mut last = [0_u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let code = data.varint()?;
        let base = &mut last[(code & 1) as usize];
        *base = base.wrapping_add(unzigzag(code >> 1));
        indices.push(*base);
    }
    data.end()?;
    Ok(indices)
}
