#![no_main]
//! Any bytes as a glTF asset, read and edited.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::asset::{Asset, Form, MaterialPair, Replacement, Slot};

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    let path = Path::new("asset.glb");
    let Ok(asset) = Asset::from_bytes(path, bytes) else { return };
    let untouched = asset.edited(&[], Form::Web, path).expect("an asset as it is");
    assert_eq!(untouched.files.last().map(|file| &file.bytes[..]), Some(bytes));
    for layer in asset.layers() {
        let Ok(pair) = layer.pair else { continue };
        let _ = (asset.normals(&pair), asset.roughness(&pair), asset.appearance(layer.material));
        let layers = vec![MaterialPair { material: layer.material, pair }];
        let ktx2 = b"ktx2".to_vec();
        let one = Replacement { slot: Slot::Roughness, layers, name: "r".to_owned(), ktx2, fallback: None };
        if let Ok(edited) = asset.edited(&[one], Form::Web, path) {
            let document = &edited.files.last().expect("a document").bytes;
            Asset::from_bytes(path, document).expect("what was written is read");
        }
    }
});
