//! Choice of the channels that make up a picture, among layers and parts.

use std::path::Path;

use ::exr::prelude::{AnyChannel, FlatSamples};

use crate::MapError;

/// Channels of a part, of which one may choose.
pub(super) type PartChannels<'a> = Vec<&'a AnyChannel<FlatSamples>>;

/// Names of all channels, for messages.
pub(super) fn channel_names(parts: &[PartChannels<'_>]) -> String {
    let all = parts.iter().flat_map(|channels| channels.iter().map(|c| c.name.to_string()));
    all.collect::<Vec<_>>().join(", ")
}

/// Channels of one layer that make up a picture.
pub(super) struct Choice<'a> {
    pub(super) part: usize,
    pub(super) channels: Vec<&'a AnyChannel<FlatSamples>>,
    /// Name of the layer, where the file has no plain channels.
    pub(super) warning: Option<String>,
}

/// Most channels that a picture is looked for in.
const MOST_CHANNELS: usize = 1024;

/// Names of a picture's channels, in the order in which they are looked for: colours, then vectors.
const COLOURS_AND_VECTORS: [&[&str]; 4] =
    [&["R", "G", "B"], &["X", "Y", "Z"], &["NX", "NY", "NZ"], &["RED", "GREEN", "BLUE"]];

/// Chooses the channels of a picture: the plain ones of the first part (R, G, B; X, Y, Z; ...), else those of
/// the only layer that has such a set, else R and G, else the only channel that is no alpha.
///
/// # Errors
/// [`MapError`] that lists the channels, where there are several layers to choose from.
pub(super) fn choose_channels<'a>(path: &Path, parts: &[PartChannels<'a>]) -> Result<Choice<'a>, MapError> {
    let count: usize = parts.iter().map(Vec::len).sum();
    if count > MOST_CHANNELS {
        let reason = format!("has {count} channels; at most {MOST_CHANNELS} are read");
        return Err(MapError::unsupported(path, reason));
    }
    let mut layers: Vec<(usize, String)> = Vec::new();
    for (part, channels) in parts.iter().enumerate() {
        for channel in channels.iter() {
            let layer = (part, layer_and_name(channel).0);
            if !layers.contains(&layer) {
                layers.push(layer);
            }
        }
    }
    let set = |(part, layer): &(usize, String), names: &[&str]| -> Option<PartChannels<'a>> {
        let find = |name: &&str| {
            parts[*part].iter().copied().find(|c| layer_and_name(c) == (layer.clone(), (*name).to_owned()))
        };
        names.iter().map(find).collect()
    };
    let triple = |layer: &(usize, String)| COLOURS_AND_VECTORS.iter().find_map(|names| set(layer, names));
    let plain = (0, String::new());
    if let Some(channels) = triple(&plain) {
        return Ok(Choice { part: 0, channels, warning: None });
    }
    let mut found: Vec<_> = layers.iter().filter_map(|layer| Some((layer, triple(layer)?))).collect();
    if let (Some(channels), true) = (set(&plain, &["R", "G"]), found.is_empty()) {
        return Ok(Choice { part: 0, channels, warning: None });
    }
    if found.is_empty() {
        let alpha = |c: &AnyChannel<FlatSamples>| matches!(layer_and_name(c).1.as_str(), "A" | "ALPHA");
        for layer in &layers {
            let single = parts[layer.0].iter().filter(|c| layer_and_name(c).0 == layer.1 && !alpha(c));
            found.extend(single.map(|c| (layer, vec![*c])));
        }
    }
    let names = || channel_names(parts);
    match &found[..] {
        [(layer, channels)] => {
            let named = !layer.1.is_empty() || layer.0 > 0;
            let warning = named.then(|| {
                let taken: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
                format!("has layers: {} are taken", taken.join(", "))
            });
            Ok(Choice { part: layer.0, channels: channels.clone(), warning })
        }
        [] => Err(MapError::unsupported(path, format!("has no channels of a picture, only {}", names()))),
        _ => {
            let reason = format!("has several layers: name one with `--layer`. Channels: {}", names());
            Err(MapError::unsupported(path, reason))
        }
    }
}

/// Layer and name of a channel, `Layer.Name`, the name in capitals.
pub(super) fn layer_and_name(channel: &AnyChannel<FlatSamples>) -> (String, String) {
    let name = channel.name.to_string();
    match name.rsplit_once('.') {
        Some((layer, name)) => (layer.to_owned(), name.to_uppercase()),
        None => (String::new(), name.to_uppercase()),
    }
}
