//! Sizes and plain two-dimensional arrays, rows from the top of the picture down.

/// Width and height in texels, both at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Size {
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Error of a size with a zero in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a map needs at least one texel, not {width} × {height}")]
pub struct EmptySize {
    width: usize,
    height: usize,
}

impl Size {
    /// A size with at least one texel.
    ///
    /// # Errors
    /// [`EmptySize`] when a side is zero.
    pub fn new(width: usize, height: usize) -> Result<Self, EmptySize> {
        if width == 0 || height == 0 { Err(EmptySize { width, height }) } else { Ok(Self { width, height }) }
    }

    /// Number of texels.
    #[must_use]
    pub fn area(self) -> usize {
        self.width * self.height
    }
}

/// A row-major array, one `T` a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<T> {
    size: Size,
    texels: Vec<T>,
}

impl<T> Grid<T> {
    /// Fills a grid by calling `texel(x, y)`, row by row.
    pub fn from_fn(size: Size, mut texel: impl FnMut(usize, usize) -> T) -> Self {
        let mut texels = Vec::with_capacity(size.area());
        for y in 0..size.height {
            texels.extend((0..size.width).map(|x| texel(x, y)));
        }
        Self { size, texels }
    }

    /// Takes `texels`, row by row; `None` when their number is not the size's area.
    pub fn from_vec(size: Size, texels: Vec<T>) -> Option<Self> {
        (texels.len() == size.area()).then_some(Self { size, texels })
    }

    /// Row `y`, mutable; it must lie inside.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        let width = self.size.width;
        &mut self.texels[y * width..][..width]
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Row `y`, which must lie inside.
    pub fn row(&self, y: usize) -> &[T] {
        &self.texels[y * self.size.width..][..self.size.width]
    }

    /// All texels, row by row.
    pub fn texels(&self) -> &[T] {
        &self.texels
    }
}
