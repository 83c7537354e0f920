//! Figures, a file each.

pub(crate) mod han_1;
pub(crate) mod han_2;
pub(crate) mod han_3;
pub(crate) mod han_4;
pub(crate) mod han_5;
pub(crate) mod han_6;
pub(crate) mod han_7;
pub(crate) mod han_8;
pub(crate) mod han_9;
pub(crate) mod han_order;
pub(crate) mod leadr_figure_5;
pub(crate) mod leadr_figure_6;
pub(crate) mod leadr_tables;
pub(crate) mod olano_1;
pub(crate) mod olano_2;
pub(crate) mod olano_7;
pub(crate) mod olano_densities;
pub(crate) mod tan_1;
pub(crate) mod tan_4;
pub(crate) mod tan_5;
pub(crate) mod tan_6;
pub(crate) mod tan_7;
pub(crate) mod tan_8;
pub(crate) mod tan_speed;

pub(crate) mod colours;
pub(crate) mod texels;
