//! Macros that turn the lists of knobs and effects (`rungs.rs`) into types.

/// A type whose values are the rungs of a knob. A rung's comment is one sentence: what it does, and what it loses.
macro_rules! knob {
    (
        $(#[$doc:meta])*
        $Type:ident = $name:literal { $( #[doc = $rung_about:expr] $Rung:ident = $rung:literal ),+ $(,)? }
        presets: [$local:ident, $recursive:ident, $global:ident],
        exact: $exact:ident,
        lecture: [$($lecture:literal),*],
        effects: [$($Effect:ident),*],
        about: $about:literal,
    ) => {
        #[doc = concat!("Knob `", $name, "`: ", $about, ".")]
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $Type {
            $( #[doc = concat!("`", $rung, "`:")] #[doc = $rung_about] $Rung, )+
        }

        impl $Type {
            pub(super) const NAME: &str = $name;
            /// All rungs, from cheap to exact.
            pub const RUNGS: &[Self] = &[$( Self::$Rung ),+];
            pub(super) const NAMES: &[&str] = &[$( $rung ),+];
            // The text of a `///` comment begins with a space.
            pub(super) const RUNG_ABOUT: &[&str] = &[$( $rung_about.trim_ascii() ),+];
            pub(super) const PRESETS: [Self; 3] = [Self::$local, Self::$recursive, Self::$global];
            pub(super) const EXACT: Self = Self::$exact;
            pub(super) const LECTURE: &[&str] = &[$( $lecture ),*];
            pub(super) const EFFECTS: &[EffectId] = &[$( EffectId::$Effect ),*];
            pub(super) const ABOUT: &str = $about;

            /// The knob with this rung.
            #[must_use]
            pub const fn choice(self) -> Choice {
                Choice { knob: Self::NAME, rung: self.name() }
            }

            /// The rung's name on the command line.
            #[must_use]
            pub const fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }
        }

        impl Default for $Type {
            /// The rung of the model `recursive`.
            fn default() -> Self {
                Self::$recursive
            }
        }

        impl std::fmt::Display for $Type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.choice().fmt(f)
            }
        }
    };
}

/// [`Knobs`] with one field per knob, and [`KNOBS`] with one entry per knob.
macro_rules! knobs {
    ($( $field:ident: $Type:ident ),+ $(,)?) => {
        /// The rungs of all knobs.
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub struct Knobs {
            $( #[doc = concat!("Rung of the knob `", stringify!($field), "`.")] pub $field: $Type, )+
        }

        /// Every knob. The command line, the report, the viewer and the documentation read this table.
        pub static KNOBS: &[Knob] = &[$( Knob {
            name: $Type::NAME,
            rungs: $Type::NAMES,
            rung_about: $Type::RUNG_ABOUT,
            presets: [$Type::PRESETS[0].name(), $Type::PRESETS[1].name(), $Type::PRESETS[2].name()],
            exact: $Type::EXACT.name(),
            lecture: $Type::LECTURE,
            effects: $Type::EFFECTS,
            about: $Type::ABOUT,
            chosen: |knobs| knobs.$field as usize,
            choose: |knobs, place| knobs.$field = $Type::RUNGS[place],
        } ),+];

        impl Knobs {
            /// The preset of a model.
            #[must_use]
            pub fn of(model: Model) -> Self {
                Self { $( $field: $Type::PRESETS[model as usize] ),+ }
            }

            /// The rungs of path tracing with the least approximation, with the samples of `global`.
            #[must_use]
            pub fn exact() -> Self {
                Self { $( $field: $Type::EXACT ),+ }
            }
        }
    };
}

/// [`EffectId`] with the name and the table row of each effect.
macro_rules! effects {
    ($( $Effect:ident = $name:literal: $cause:literal => $brings:literal, )+) => {
        /// An effect that a scene may call for.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum EffectId {
            $( #[doc = concat!("`", $name, "`.")] $Effect, )+
            /// A lobe of a material extension, by its index in [`LOBES`].
            Lobe(usize),
        }

        impl EffectId {
            /// The effect's name in reports.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $( Self::$Effect => $name, )+
                    Self::Lobe(place) => LOBES[place].name,
                }
            }

            /// The effect's cause in a scene and its consequence for a plan: a row of docs/plan.md.
            #[must_use]
            pub fn row(self) -> [&'static str; 2] {
                match self {
                    $( Self::$Effect => [$cause, $brings], )+
                    Self::Lobe(place) => LOBES[place].row,
                }
            }

            /// Every effect, in the order in which plans list them.
            pub fn all() -> impl Iterator<Item = Self> {
                [$( Self::$Effect ),+].into_iter().chain((0..LOBES.len()).map(Self::Lobe))
            }

            /// The effect with a name.
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                Self::all().find(|effect| effect.name() == name)
            }
        }
    };
}
