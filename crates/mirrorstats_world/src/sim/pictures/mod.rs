pub mod camera;
#[cfg(feature = "raster")]
pub mod contact_sheet;
pub mod label_image;
pub mod passage;
