//! OpenEXR by the `exr` crate: plain pictures in, and normal distribution maps in and out in two layouts.
//!
//! **Native**: one part a layer, named `layer0`, `layer1` ..., RGBA, tiled and mip-mapped, with the
//! header as the attribute `ndfmap`. **Bumpslopes**: OpenImageIO's six channels, for `slopes`, as
//! `maketx --bumpslopes` writes them: slopes of a height map per texel in the file's own units with t
//! down the image, slopes of a normal map as `-n.xy / n.z` of the vectors as stored, and `b0_h` = -1.

mod choice;

use std::io::{Cursor, Write};
use std::path::Path;

use ::exr::math::RoundingMode;
use ::exr::meta::attribute::{AttributeValue, EnvironmentMap, Text};
use ::exr::meta::{BlockDescription, MetaData};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, Levels, LineOrder, ReadChannels, ReadLayers, SpecificChannels,
    Vec2, WritableImage, f16, read,
};
use glam::Vec3;
use ndfmap_core::grid::Size;
use ndfmap_core::ndf::Encoding as Channels;
use ndfmap_core::pyramid::{Precision, Pyramid, level_sizes};
use ndfmap_scene::metrics::Picture;

use self::choice::{PartChannels, channel_names, choose_channels, layer_and_name};
use super::{ChannelLayout, EncodedPicture, Format, WriteOptions, WritePicture, decoded};
use crate::atomic::AtomicFile;
use crate::header::{Source, SourceKind, VERSION};
use crate::image::{MAX_TEXELS, check_size};
use crate::{Header, Image, MapError, NdfMap, Samples};

pub(super) const FORMAT: Format = Format {
    name: "OpenEXR",
    extensions: &["exr", "tx"],
    magic: &[b"\x76\x2f\x31\x01"],
    read_ndf: Some(read_ndf),
    write_ndf: Some(write_ndf),
    write_picture: Some(WritePicture::Linear(write_picture)),
    ..Format::read_by(read_image)
};

/// The attribute that holds our [`Header`].
const KEY: &str = "ndfmap";

/// OpenImageIO's channels, in the order of its file.
pub const BUMPSLOPES: [&str; 6] = ["b0_h", "b1_dhds", "b2_dhdt", "b3_dhds2", "b4_dhdt2", "b5_dh2dsdt"];

/// Tiles of this many texels a side, as OpenImageIO's own.
const TILE: usize = 64;

type AnyLayer = Layer<AnyChannels<Levels<FlatSamples>>>;

/// Checks every part of the header, before any texel is read.
fn check_header(path: &Path, bytes: &[u8]) -> Result<(), MapError> {
    let meta = metadata(path, bytes)?;
    let mut total = 0;
    for header in &meta.headers {
        let size = check_size(path, header.layer_size.width(), header.layer_size.height())?;
        total += size.area() * header.channels.list.len();
        if let BlockDescription::Tiles(tiles) = &header.blocks
            && tiles.tile_size.width().saturating_mul(tiles.tile_size.height()) > 1 << 20
        {
            return Err(MapError::unsupported(path, "has tiles of more than 2²⁰ texels"));
        }
    }
    // Zip's best is 1032 to 1, of at least two bytes a sample; the other codecs stay below on any map.
    if total > 8 * MAX_TEXELS || total / 516 > bytes.len() {
        let reason = format!("is truncated: {} bytes cannot hold the {total} samples it claims", bytes.len());
        return Err(MapError::invalid(path, reason));
    }
    Ok(())
}

/// True for blocks whose decoder may panic on a damaged file (found by fuzzing: B44). In a thread of the
/// decoder's own a panic would end the program; in ours it is caught.
fn is_fragile(meta: &MetaData) -> bool {
    meta.headers.iter().any(|header| matches!(header.compression, Compression::B44 | Compression::B44A))
}

fn guarded<T>(path: &Path, decode: impl FnOnce() -> ::exr::error::Result<T>) -> Result<T, MapError> {
    decoded::guarded(path, "OpenEXR", decode)?.map_err(|e| MapError::invalid(path, e))
}

/// The headers of all parts, of which there is at least one.
fn metadata(path: &Path, bytes: &[u8]) -> Result<MetaData, MapError> {
    let meta = guarded(path, || MetaData::read_from_buffered(Cursor::new(bytes), false))?;
    if meta.headers.is_empty() {
        return Err(MapError::invalid(path, "is an OpenEXR file without any part"));
    }
    Ok(meta)
}

/// The text of our header, if the file has one.
fn header_text(meta: &MetaData) -> Option<String> {
    let first = &meta.headers[0];
    [&first.shared_attributes.other, &first.own_attributes.other].into_iter().find_map(|other| {
        match other.get(&Text::from(KEY)) {
            Some(AttributeValue::Text(text)) => Some(text.to_string()),
            _ => None,
        }
    })
}

/// True when the first part has OpenImageIO's six channels.
fn has_bumpslopes(meta: &MetaData) -> bool {
    let channels = &meta.headers[0].channels.list;
    BUMPSLOPES.iter().all(|name| channels.iter().any(|c| c.name.eq_case_insensitive(name)))
}

/// Largest frame that a crop of any size may lie in, in texels; larger ones are at most sixteen times the
/// crop.
const LARGE_FRAME: usize = 1 << 24;

/// True for a file that says of itself that it is a cube of an environment, by OpenEXR's definition.
pub(crate) fn is_cube(path: &Path, bytes: &[u8]) -> bool {
    let says_cube =
        |meta: MetaData| meta.headers[0].own_attributes.environment_map == Some(EnvironmentMap::Cube);
    bytes.starts_with(FORMAT.magic[0]) && metadata(path, bytes).is_ok_and(says_cube)
}

fn read_image(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    read_layer(path, bytes, None)
}

/// Reads a picture: that of the layer or part of this name, else the only one there is.
pub(super) fn read_layer(path: &Path, bytes: &[u8], layer: Option<&str>) -> Result<Image, MapError> {
    check_header(path, bytes)?;
    let meta = metadata(path, bytes)?;
    if header_text(&meta).is_some() || has_bumpslopes(&meta) {
        return Err(MapError::baked(path));
    }
    let image = guarded(path, || {
        let reader = read().no_deep_data().largest_resolution_level().all_channels();
        let reader = reader.all_layers().all_attributes();
        let reader = if is_fragile(&meta) { reader.non_parallel() } else { reader };
        reader.from_buffered(Cursor::new(bytes))
    })?;
    let mut parts: Vec<PartChannels<'_>> =
        image.layer_data.iter().map(|part| part.channel_data.list.iter().collect()).collect();
    if let Some(layer) = layer {
        let whole = |part: usize| {
            image.layer_data[part].attributes.layer_name.as_ref().is_some_and(|name| name == layer)
        };
        let all = channel_names(&parts);
        for (_, channels) in parts.iter_mut().enumerate().filter(|(part, _)| !whole(*part)) {
            channels.retain(|channel| layer_and_name(channel).0 == layer || channel.name == *layer);
        }
        if parts.iter().all(Vec::is_empty) {
            let reason = format!("has no layer, part or channel `{layer}`. Channels: {all}");
            return Err(MapError::unsupported(path, reason));
        }
    }
    let choice = choose_channels(path, &parts)?;
    let part = &image.layer_data[choice.part];
    let size = check_size(path, part.size.width(), part.size.height())?;
    if choice.channels.iter().any(|c| c.sampling != Vec2(1, 1)) {
        return Err(MapError::unsupported(path, "has subsampled channels; full resolution is read"));
    }
    // A crop of its display window, whose other texels are 0.
    let window = image.attributes.display_window;
    let frame = check_size(path, window.size.width(), window.size.height())?;
    if frame.area() > LARGE_FRAME && frame.area() / 16 > size.area() {
        let (w, h) = (frame.width, frame.height);
        let reason = format!("holds less than a sixteenth of the {w} × {h} texels of its display window");
        return Err(MapError::unsupported(path, reason));
    }
    let (own, display) = (part.attributes.layer_position, window.position);
    let place = [i64::from(own.x()) - i64::from(display.x()), i64::from(own.y()) - i64::from(display.y())];
    let inside = |at: usize, place: i64, length: usize| {
        usize::try_from(at as i64 + place).ok().filter(|at| *at < length)
    };
    let channels = choice.channels.len();
    let mut samples = vec![0.0; frame.area() * channels];
    for (at, channel) in choice.channels.iter().enumerate() {
        for (i, value) in channel.sample_data.values_as_f32().enumerate() {
            let x = inside(i % size.width, place[0], frame.width);
            let y = inside(i / size.width, place[1], frame.height);
            if let (Some(x), Some(y)) = (x, y) {
                samples[(y * frame.width + x) * channels + at] = value;
            }
        }
    }
    let mut picture = Image::new(path, frame, channels, Samples::F32(samples))?;
    if (frame, place) != (size, [0, 0]) {
        let (w, h) = (size.width, size.height);
        let reason = format!("holds {w} × {h} of {} × {} texels; the rest is 0", frame.width, frame.height);
        picture.warnings.push(reason);
    }
    picture.warnings.extend(choice.warning);
    Ok(picture)
}

fn read_ndf(path: &Path, bytes: &[u8]) -> Result<Option<NdfMap>, MapError> {
    check_header(path, bytes)?;
    let meta = metadata(path, bytes)?;
    let (text, bumpslopes) = (header_text(&meta), has_bumpslopes(&meta));
    let first = &meta.headers[0];
    if text.is_none() && !bumpslopes {
        return Ok(None);
    }
    let header = text.map(|t| Header::from_json(path, &t)).transpose()?;
    let image = guarded(path, || {
        let reader = read().no_deep_data().all_resolution_levels().all_channels();
        let reader = reader.all_layers().all_attributes();
        let reader = if is_fragile(&meta) { reader.non_parallel() } else { reader };
        reader.from_buffered(Cursor::new(bytes))
    })?;
    let layers: Vec<AnyLayer> = image.layer_data.into_iter().collect();
    if bumpslopes {
        let wraps = spell_oiio_wraps(
            &first.own_attributes.wrap_mode_name.as_ref().map(Text::to_string).unwrap_or_default(),
        );
        return read_bumpslopes(path, header, &layers[0], wraps).map(Some);
    }
    let Some(header) = header else { return Ok(None) };
    read_native(path, header, &layers).map(Some)
}

/// OpenImageIO's `swrap,twrap`; black and mirror are read as clamp, the nearest that we have.
fn spell_oiio_wraps(text: &str) -> [String; 2] {
    let mut words = text.split(',');
    let mut wrap = || if words.next() == Some("periodic") { "repeat".to_owned() } else { "clamp".to_owned() };
    [wrap(), wrap()]
}

/// Values of a channel on a level, as many as the level has texels.
fn level_values(
    path: &Path,
    channel: &AnyChannel<Levels<FlatSamples>>,
    level: usize,
    size: Size,
) -> Result<Vec<f32>, MapError> {
    let samples = match &channel.sample_data {
        Levels::Singular(samples) if level == 0 => Some(samples),
        Levels::Mip { rounding_mode: RoundingMode::Down, level_data } => level_data.get(level),
        _ => None,
    };
    let values: Option<Vec<f32>> = samples.map(|s| s.values_as_f32().collect());
    values.filter(|v| v.len() == size.area()).ok_or_else(|| {
        let expected = "mip-mapped, rounding down";
        MapError::invalid(
            path,
            format!("lacks level {level} of channel {}; maps are {expected}", channel.name),
        )
    })
}

/// Precision of all channels: half when every channel is.
fn precision_of(layers: &[AnyLayer]) -> Precision {
    let half = |samples: &Levels<FlatSamples>| match samples {
        Levels::Singular(FlatSamples::F16(_)) => true,
        Levels::Mip { level_data, .. } => level_data.iter().all(|s| matches!(s, FlatSamples::F16(_))),
        _ => false,
    };
    let all = layers.iter().flat_map(|l| &l.channel_data.list).all(|c| half(&c.sample_data));
    if all { Precision::Half } else { Precision::Single }
}

fn read_native(path: &Path, header: Header, layers: &[AnyLayer]) -> Result<NdfMap, MapError> {
    let size = check_size(path, header.width, header.height)?;
    let precision = precision_of(layers);
    let mut levels = Vec::new();
    for (level, size) in level_sizes(size).into_iter().enumerate() {
        let mut bytes = Vec::new();
        for layer in layers {
            let mut rgba = vec![0.0; size.area() * 4];
            for (at, name) in ["R", "G", "B", "A"].iter().enumerate() {
                let channel = layer.channel_data.list.iter().find(|c| c.name.eq_case_insensitive(name));
                let channel =
                    channel.ok_or_else(|| MapError::invalid(path, format!("lacks channel {name}")))?;
                for (i, value) in level_values(path, channel, level, size)?.into_iter().enumerate() {
                    rgba[i * 4 + at] = value;
                }
            }
            precision.pack(&rgba, &mut bytes);
        }
        levels.push(bytes);
    }
    NdfMap::assemble(path, header, precision, levels)
}

/// Factors from our height and slopes to bumpslopes' units: b0 = h × `height`, b1 = x × `s`, b2 = y × `t`.
struct BumpslopeUnits {
    height: f32,
    s: f32,
    t: f32,
}

impl BumpslopeUnits {
    fn of(source: &Source, width: usize) -> Self {
        match source.kind {
            SourceKind::Height => {
                let per_unit = 1.0 / source.height_scale.unwrap_or(1.0) as f32;
                let per_texel = per_unit / width as f32;
                Self { height: per_unit, s: per_texel, t: -per_texel }
            }
            SourceKind::Normal => {
                let t = if source.convention.as_deref() == Some("directx") { -1.0 } else { 1.0 };
                Self { height: 0.0, s: 1.0, t }
            }
        }
    }
}

fn read_bumpslopes(
    path: &Path,
    header: Option<Header>,
    layer: &AnyLayer,
    wrap: [String; 2],
) -> Result<NdfMap, MapError> {
    let size = check_size(path, layer.size.width(), layer.size.height())?;
    let channel = |name: &str| {
        let found = layer.channel_data.list.iter().find(|c| c.name.eq_case_insensitive(name));
        found.ok_or_else(|| MapError::invalid(path, format!("lacks channel {name}")))
    };
    let channels = BUMPSLOPES.map(channel);
    let mut six = Vec::with_capacity(6);
    for channel in channels {
        six.push(channel?);
    }
    let header = match header {
        Some(header) => header,
        None => {
            // OpenImageIO writes -1 for the height where the source was a normal map.
            let heights = level_values(path, six[0], 0, size)?;
            let kind =
                if heights.iter().all(|h| *h == -1.0) { SourceKind::Normal } else { SourceKind::Height };
            let (height_scale, convention) = match kind {
                SourceKind::Height => (Some(1.0), None),
                SourceKind::Normal => (None, Some("opengl".to_owned())),
            };
            let file = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            let source = Source { file, kind, sha256: String::new(), height_scale, convention };
            Header {
                version: VERSION,
                method: "slopes".to_owned(),
                width: size.width,
                height: size.height,
                wrap,
                encoding: "sums".to_owned(),
                attributes: Vec::new(),
                source,
                compact: None,
                from_level: 0,
            }
        }
    };
    let units = BumpslopeUnits::of(&header.source, size.width);
    // Slopes per texture width are larger than per texel: half floats would overflow sooner.
    let precision = Precision::Single;
    let mut levels = Vec::new();
    for (level, size) in level_sizes(size).into_iter().enumerate() {
        let mut values = Vec::with_capacity(6);
        for channel in &six {
            values.push(level_values(path, channel, level, size)?);
        }
        let mut rgba = vec![1.0; size.area() * 8];
        let (first, second) = rgba.split_at_mut(size.area() * 4);
        let height = if units.height > 0.0 { 1.0 / units.height } else { 0.0 };
        for i in 0..size.area() {
            let b = |c: usize| values[c][i];
            first[i * 4..][..3].copy_from_slice(&[b(0) * height, b(1) / units.s, b(2) / units.t]);
            let (ss, tt, st) = (units.s * units.s, units.t * units.t, units.s * units.t);
            second[i * 4..][..3].copy_from_slice(&[b(3) / ss, b(4) / tt, b(5) / st]);
        }
        let mut bytes = Vec::new();
        precision.pack(&rgba, &mut bytes);
        levels.push(bytes);
    }
    NdfMap::assemble(path, header, precision, levels)
}

/// Writes a picture: 32-bit floats of linear RGB.
fn write_picture(picture: &Picture) -> EncodedPicture {
    let size = picture.size();
    let channels = SpecificChannels::rgb(|p: Vec2<usize>| {
        let Vec3 { x, y, z } = picture.row(p.y())[p.x()];
        (x, y, z)
    });
    // In any other order, blocks lie in the file as threads finish them.
    let encoding = Encoding { line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS };
    let layer = Layer::new((size.width, size.height), LayerAttributes::default(), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().to_buffered(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

/// Writes a map in either layout of channels.
fn write_ndf(path: &Path, map: &NdfMap, options: &WriteOptions) -> Result<u64, MapError> {
    if options.zstd.is_some() {
        return Err(MapError::unsupported(path, "Zstandard is for KTX2; an OpenEXR is compressed as it is"));
    }
    match options.channels {
        ChannelLayout::Native => write_native(path, map),
        ChannelLayout::Bumpslopes => {
            write_bumpslopes(path, map, options.precision.unwrap_or(map.pyramid.precision()))
        }
    }
}

/// Writes the native layout; returns the file's length.
fn write_native(path: &Path, map: &NdfMap) -> Result<u64, MapError> {
    let pyramid = &map.pyramid;
    let layers = (0..pyramid.layers()).map(|layer| {
        let levels = |channel: usize| {
            mip(pyramid, pyramid.precision(), |level| channel_of(pyramid, level, layer, channel))
        };
        let channels =
            ["R", "G", "B", "A"].iter().enumerate().map(|(c, name)| AnyChannel::new(*name, levels(c)));
        (format!("layer{layer}"), AnyChannels::sort(channels.collect()))
    });
    write_layers(path, map, layers.collect())
}

/// Writes OpenImageIO's six channels in this precision; returns the file's length.
///
/// Heights change their units on the way, so a map in single precision has them rounded once.
fn write_bumpslopes(path: &Path, map: &NdfMap, precision: Precision) -> Result<u64, MapError> {
    if map.method(path)?.encoding() != Channels::SlopeMoments {
        let reason = format!("the bumpslopes layout holds the method `slopes`, not `{}`", map.header.method);
        return Err(MapError::unsupported(path, reason));
    }
    let pyramid = &map.pyramid;
    let units = BumpslopeUnits::of(&map.header.source, map.header.width);
    let is_normal = map.header.source.kind == SourceKind::Normal;
    // (layer, channel) of our slopes, and its unit.
    let places = [
        (0, 0, units.height),
        (0, 1, units.s),
        (0, 2, units.t),
        (1, 0, units.s * units.s),
        (1, 1, units.t * units.t),
        (1, 2, units.s * units.t),
    ];
    let channel = |(name, (layer, channel, unit)): (&&str, (usize, usize, f32))| {
        let values = |level| {
            let mut values = channel_of(pyramid, level, layer, channel);
            values
                .iter_mut()
                .for_each(|v| *v = if is_normal && *name == BUMPSLOPES[0] { -1.0 } else { *v * unit });
            values
        };
        AnyChannel::new(*name, mip(pyramid, precision, values))
    };
    let channels = AnyChannels::sort(BUMPSLOPES.iter().zip(places).map(channel).collect());
    write_layers(path, map, vec![(String::new(), channels)])
}

fn channel_of(pyramid: &Pyramid, level: usize, layer: usize, channel: usize) -> Vec<f32> {
    let bytes = pyramid.level_bytes(level);
    let length = bytes.len() / pyramid.layers();
    let (precision, texel) = (pyramid.precision(), pyramid.precision().texel_bytes());
    let mut values = Vec::with_capacity(length / texel);
    for rgba in bytes[layer * length..][..length].chunks_exact(texel) {
        precision.unpack(&rgba[channel * texel / 4..][..texel / 4], &mut values);
    }
    values
}

fn mip(pyramid: &Pyramid, precision: Precision, values: impl Fn(usize) -> Vec<f32>) -> Levels<FlatSamples> {
    let store = |level| {
        let values = values(level);
        match precision {
            Precision::Half => FlatSamples::F16(values.into_iter().map(f16::from_f32).collect()),
            Precision::Single => FlatSamples::F32(values),
        }
    };
    Levels::Mip {
        rounding_mode: RoundingMode::Down,
        level_data: (0..pyramid.sizes().len()).map(store).collect(),
    }
}

fn write_layers(
    path: &Path,
    map: &NdfMap,
    parts: Vec<(String, AnyChannels<Levels<FlatSamples>>)>,
) -> Result<u64, MapError> {
    let size = Vec2(map.header.width, map.header.height);
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
    attributes.other.insert(Text::from(KEY), text(&map.header.to_json()));
    let oiio = |wrap: &String| if wrap == "repeat" { "periodic" } else { "clamp" };
    let wraps = map.header.wrap.each_ref().map(oiio).join(",");
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::Tiles(Vec2(TILE, TILE)),
        line_order: LineOrder::Increasing,
    };
    let layers: ::exr::prelude::Layers<_> = parts
        .into_iter()
        .map(|(name, channels)| {
            let mut own = if name.is_empty() {
                LayerAttributes::default()
            } else {
                LayerAttributes::named(name.as_str())
            };
            // OpenImageIO's texture system then takes the file for a texture and wraps it as it was baked.
            own.wrap_mode_name = Some(Text::from(wraps.as_str()));
            own.other.insert(Text::from("textureformat"), text("Plain Texture"));
            Layer::new(size, own, encoding, channels)
        })
        .collect();
    let image = ExrImage { attributes, layer_data: layers };
    let mut file = AtomicFile::create(path)?;
    let mut buffered = std::io::BufWriter::new(file.file());
    image.write().to_buffered(&mut buffered).map_err(|e| MapError::invalid(path, e))?;
    buffered.flush().map_err(|e| MapError::io(path, e))?;
    drop(buffered);
    let length = file.file().metadata().map_err(|e| MapError::io(path, e))?.len();
    file.finish()?;
    Ok(length)
}

fn text(text: &str) -> AttributeValue {
    AttributeValue::Text(Text::from(text))
}
