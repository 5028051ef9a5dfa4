pub(crate) mod statistics;
pub mod verify;
