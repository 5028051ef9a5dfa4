pub(super) mod continued;
pub mod failures;
pub mod index;
pub mod lock;
#[cfg(feature = "view")]
pub mod participants;
pub mod store;
