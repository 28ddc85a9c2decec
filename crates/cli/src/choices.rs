//! Enums of the library as clap option values: the strum name of a variant is the value, its doc comment the help text.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use strum::{EnumMessage, VariantArray};

/// Parser for the variants of an enum.
pub(super) fn one_of<T>() -> impl TypedValueParser<Value = T>
where
    T: VariantArray + EnumMessage + Into<&'static str> + Copy + Send + Sync + 'static,
{
    let value = |variant: &T| {
        let about = variant.get_documentation().unwrap_or_default().replace('\n', " ");
        PossibleValue::new((*variant).into()).help(about.trim_end_matches('.').to_owned())
    };
    let named = |name: String| T::VARIANTS.iter().copied().find(|&variant| name == variant.into());
    PossibleValuesParser::new(T::VARIANTS.iter().map(value)).try_map(move |name| named(name).ok_or("no such value"))
}
