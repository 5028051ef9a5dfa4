//! Enums with named variants.

/// Declares an enum whose variants have names, and gives it `ALL` (its variants in order), `name`, and `named` (the
/// variant with a name).
#[macro_export]
macro_rules! names {
    (
        $(#[$about:meta])*
        $visibility:vis enum $type:ident { $($(#[$word:meta])* $variant:ident = $name:literal),+ $(,)? }
    ) => {
        $(#[$about])*
        $visibility enum $type {
            $($(#[$word])* $variant,)+
        }

        $crate::names!($type { $($variant: $name,)+ });
    };
    ($type:ident { $($variant:ident: $name:literal),+ $(,)? }) => {
        impl $type {
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }

            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.name() == name)
            }
        }
    };
}
