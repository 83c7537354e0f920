//! Methods: how a texel stores, filters and reads the distribution of its normals.
//!
//! `bake → filter → decode → shade`. What is stored and filtered are **sums** ([`Representation::Sums`]),
//! which mix by plain weighted averaging; what is shaded are decoded parameters ([`Representation::Lobes`]).
//! Sums and lobes are two types, never one with flags. The typed contract is [`Representation`]; every one of
//! them is also a [`Method`], the same thing for callers that choose at run time, and [`AnyMethod`] owns one.
//! The form *stored* ([`Encoding`]) is apart from the way it is *read*, and a decoded texel is shaded in one
//! of three forms ([`Form`]). [`TABLE`] has one row for each method; a row buys the conformance suite in
//! `conformance.rs`. Notation: `docs/notation.md`.

mod decoded;
mod encoding;
mod environment;
mod fixed;
mod form;
mod gmm;
mod leadr;
mod method;
mod mixture;
mod naive;
mod ndm;
mod phong;
mod reflect;
mod sh;
mod slopes;
mod stereographic;
mod table;
mod toksvig;
mod vmf;

#[cfg(test)]
mod conformance;
#[cfg(test)]
mod elliptic;

pub use decoded::Decoded;
pub use encoding::{Encoding, LobeLayout, StoredSums};
pub use environment::LocalEnvironment;
pub use fixed::Fixed;
pub use form::{Form, FormKind};
pub use gmm::{GaussianMixture, Gmm};
pub use leadr::{MirroredFacet, SlopeGrid};
pub use method::{AnyMethod, Describe, Evaluator, FlatLobe, Method, Representation, Sample, Shows};
pub use mixture::{LobeSums, NormalLobe, Response, SERIES_ORDER};
pub use naive::Naive;
pub use ndm::{Ndm, NdmFactors, NdmKernel, NdmNormalisation};
pub use phong::{Phong, PhongPeaks};
pub use reflect::{FilteredTexel, IncidentLight, PreparedBrdf};
pub use sh::{Coefficients, Sh};
pub use slopes::{SlopeGaussian, SlopeMoments, Slopes};
pub use stereographic::Stereographic;
pub use table::{DEFAULT_METHOD, ParameterError, ParseMethodError, Row, TABLE};
pub use toksvig::{MeanLobe, Toksvig};
pub use vmf::{Vmf, VmfForm, VmfMixture};

use glam::DVec3;

/// Direction of a vector; `(0,0,1)` for a vector that has none.
fn direction_or_up(v: DVec3) -> DVec3 {
    v.try_normalize().unwrap_or(DVec3::Z)
}
