//! Closed lists of names: enums whose variants, order and text in messages are written once.

/// Defines an enum whose variants have names in messages. Generates `ALL`, `as_str`, `Display`,
/// `FromStr` and serde from one list, so that none of them can miss a name. In the second form,
/// each name has words for people, which a function of the given name returns.
macro_rules! names {
    (
        $(#[$meta:meta])*
        pub enum $Type:ident { $($(#[$doc:meta])* $Variant:ident = $name:tt: $words:expr,)+ }

        $(#[$about:meta])*
        fn $function:ident() -> $Words:ty;
    ) => {
        names! {
            $(#[$meta])*
            pub enum $Type { $($(#[$doc])* $Variant = $name,)+ }
        }

        impl $Type {
            $(#[$about])*
            #[must_use]
            pub const fn $function(self) -> $Words {
                match self {
                    $(Self::$Variant => $words,)+
                }
            }
        }
    };
    (
        $(#[$meta:meta])*
        pub enum $Type:ident { $($(#[$doc:meta])* $Variant:ident = $name:tt,)+ }
    ) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
        )]
        pub enum $Type {
            $($(#[$doc])* #[serde(rename = $name)] $Variant,)+
        }

        impl $Type {
            /// All variants, in the order of the documentation.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$Variant),+];

            /// Returns the name of this variant in messages.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(Self::$Variant => $name,)+
                }
            }
        }

        impl std::fmt::Display for $Type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }

        impl std::str::FromStr for $Type {
            type Err = ();

            fn from_str(text: &str) -> Result<Self, ()> {
                match text {
                    $($name => Ok(Self::$Variant),)+
                    _ => Err(()),
                }
            }
        }

        impl crate::names::Name for $Type {
            const NAMES: &'static [Self] = &Self::ALL;

            fn as_str(self) -> &'static str {
                self.as_str()
            }
        }
    };
}

pub(crate) use names;

/// A name from a fixed list, such as [`Fault`](crate::Fault) or [`ErrorCode`](crate::ErrorCode).
pub trait Name: Copy + Eq + serde::Serialize + 'static {
    /// All names of the fixed list, in the order of the documentation.
    const NAMES: &'static [Self];

    /// Returns the name as it is written in messages.
    #[must_use]
    fn as_str(self) -> &'static str;
}
