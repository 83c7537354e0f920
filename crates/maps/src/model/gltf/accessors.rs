//! Numbers of accessors, of every type that core glTF and `KHR_mesh_quantization` let them have.

use std::iter::repeat_n;

use gltf::accessor::{DataType, Item, Iter};

use super::document::Opened;
use crate::MapError;

impl Opened<'_> {
    /// Vectors of an accessor: integers that stand for fractions divided (glTF 2.0, 3.6.2.2), others as they
    /// are.
    ///
    /// # Errors
    /// [`MapError`] for other dimensions, or numbers outside their buffer.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &gltf::Accessor<'_>,
    ) -> Result<Vec<[f32; N]>, MapError>
    where
        [u8; N]: Item,
        [i8; N]: Item,
        [u16; N]: Item,
        [i16; N]: Item,
        [f32; N]: Item,
    {
        if accessor.dimensions().multiplicity() != N {
            return Err(self
                .invalid(format!("has vertices of {:?} where {N} numbers are due", accessor.dimensions())));
        }
        let fraction = |largest: f32| if accessor.normalized() { largest } else { 1.0 };
        Ok(match accessor.data_type() {
            DataType::F32 => self.items(accessor, [0.0; N])?,
            DataType::U8 => scaled(self.items(accessor, [0_u8; N])?, fraction(255.0)),
            DataType::I8 => scaled(self.items(accessor, [0_i8; N])?, fraction(127.0)),
            DataType::U16 => scaled(self.items(accessor, [0_u16; N])?, fraction(65_535.0)),
            DataType::I16 => scaled(self.items(accessor, [0_i16; N])?, fraction(32_767.0)),
            DataType::U32 => return Err(self.invalid("has vertices of 32-bit integers".to_owned())),
        })
    }

    /// Indices of an accessor.
    ///
    /// # Errors
    /// [`MapError`] for other types, or numbers outside their buffer.
    pub(super) fn indices(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<u32>, MapError> {
        Ok(match accessor.data_type() {
            DataType::U8 => self.items(accessor, 0_u8)?.into_iter().map(u32::from).collect(),
            DataType::U16 => self.items(accessor, 0_u16)?.into_iter().map(u32::from).collect(),
            DataType::U32 => self.items(accessor, 0_u32)?,
            other => return Err(self.invalid(format!("has indices of {other:?}"))),
        })
    }

    /// Items of an accessor; zeros where it has no buffer, as the format says.
    fn items<T: Item + Copy>(&self, accessor: &gltf::Accessor<'_>, zero: T) -> Result<Vec<T>, MapError> {
        if accessor.view().is_none() && accessor.sparse().is_none() {
            return Ok(repeat_n(zero, accessor.count()).collect());
        }
        let items = Iter::<T>::new(accessor.clone(), |buffer| self.buffers.get(buffer.index()).map(|b| &**b));
        let items: Vec<T> =
            items.ok_or_else(|| self.invalid("has a mesh outside its buffer".to_owned()))?.collect();
        if items.len() != accessor.count() {
            return Err(self.invalid("has a mesh outside its buffer".to_owned()));
        }
        Ok(items)
    }

    fn invalid(&self, reason: String) -> MapError {
        MapError::invalid(self.path, reason)
    }
}

/// Vectors divided by what stands for one; the least of signed integers is -1 too.
fn scaled<T: Into<f32> + Copy, const N: usize>(vectors: Vec<[T; N]>, one: f32) -> Vec<[f32; N]> {
    let number = |v: T| match v.into() {
        v if one > 1.0 => (v / one).max(-1.0),
        v => v,
    };
    vectors.into_iter().map(|vector| vector.map(number)).collect()
}
