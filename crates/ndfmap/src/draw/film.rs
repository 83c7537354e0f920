//! Moving pictures as animated PNG.

use ndfmap_core::grid::Grid;

use super::Rgb;
use crate::Error;

/// Pictures of one size as an animated PNG that repeats for ever, each shown for so many milliseconds.
///
/// # Errors
/// [`Error::Request`] without pictures, or with pictures of several sizes.
pub fn film(pictures: &[Grid<Rgb>], milliseconds: u16) -> Result<Vec<u8>, Error> {
    let size = pictures.first().map(Grid::size);
    let size = size.filter(|size| pictures.iter().all(|p| p.size() == *size));
    let size = size.ok_or_else(|| Error::Request("a film needs pictures of one size".to_owned()))?;
    let failed = |e: png::EncodingError| Error::Failed(format!("cannot write a film: {e}"));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(pictures.len() as u32, 0).map_err(failed)?;
    encoder.set_frame_delay(milliseconds, 1000).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    for picture in pictures {
        writer.write_image_data(picture.texels().as_flattened()).map_err(failed)?;
    }
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndfmap_core::grid::Size;

    #[test]
    fn films_hold_every_picture_in_order() {
        let of = |value: u8| Grid::from_fn(Size { width: 4, height: 3 }, |x, _| [value, x as u8, 0]);
        let pictures = [of(1), of(2), of(3)];
        let bytes = film(&pictures, 50).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let control = *reader.info().animation_control().unwrap();
        assert_eq!((control.num_frames, control.num_plays), (3, 0));
        let mut pixels = vec![0; 4 * 3 * 3];
        for picture in &pictures {
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, picture.texels().as_flattened());
        }
        assert!(
            film(&[], 50).is_err()
                && film(&[of(1), Grid::from_fn(Size { width: 1, height: 1 }, |_, _| [0; 3])], 9).is_err()
        );
    }
}
