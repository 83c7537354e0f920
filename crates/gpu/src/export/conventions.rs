//! Conventions of renderers with materials: what each does around a density of facets.
//!
//! In [`TABLE`] a row is a renderer: its masking, its Fresnel, what facets pass on to each other, its least
//! width, and the level of a blurred cube that a roughness reads. `docs/your-renderer.md` says which were
//! read in the renderer's own source.

/// A row of [`TABLE`].
#[derive(Debug)]
pub struct Convention {
    /// Spelling on the command line.
    pub name: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Functions in WGSL that `material.wgsl` calls.
    pub(super) text: &'static str,
}

/// Every convention.
pub static TABLE: &[Convention] = &[
    Convention {
        name: "plain",
        summary: "Smith's masking, Schlick's Fresnel, light reflected once",
        text: include_str!("conventions/plain.wgsl"),
    },
    Convention {
        name: "three",
        summary: "the physical material of three.js r187",
        text: include_str!("conventions/three.wgsl"),
    },
    Convention {
        name: "babylon",
        summary: "the material PBR of Babylon.js 9",
        text: include_str!("conventions/babylon.wgsl"),
    },
    Convention {
        name: "bevy",
        summary: "the standard material of Bevy 0.19",
        text: include_str!("conventions/bevy.wgsl"),
    },
    Convention {
        name: "godot",
        summary: "the standard material of Godot 4",
        text: include_str!("conventions/godot.wgsl"),
    },
    Convention {
        name: "unity",
        summary: "the lit material of Unity's universal pipeline",
        text: include_str!("conventions/unity.wgsl"),
    },
    Convention {
        name: "unreal",
        summary: "the default lit material of Unreal",
        text: include_str!("conventions/unreal.wgsl"),
    },
];
