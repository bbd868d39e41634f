//! Units of variables, from doc comments: the text after a comma, if it is a unit.
//!
//! | doc comment | unit |
//! | --- | --- |
//! | `/// Position, m.` of a field | `m` of the field and of everything in it |
//! | ``/// - `x[1]`: velocity, m/s`` of a model | `m/s` of this variable; of `x` all states |
//! | ``/// - `t`: s`` of a model | `s` of the time |
//! | `/// Tension of the tether, N.` of a function | `N` of all outputs |

use super::Variables;
use syn::{Attribute, Expr, ExprLit, Lit, Meta};

/// The units of the variables, of the time, and of the outputs of a function; empty if unknown. A
/// list without any unit may be empty.
#[derive(Clone, Debug, Default)]
pub struct Units {
    /// The units of the differential states.
    pub x: Vec<String>,
    /// The units of the algebraic states.
    pub z: Vec<String>,
    /// The units of the controls.
    pub u: Vec<String>,
    /// The units of the parameters.
    pub p: Vec<String>,
    /// The unit of the time.
    pub t: String,
    /// The unit of all outputs of a function.
    pub outputs: String,
}

impl Units {
    /// Adds the units of the list in the model's documentation, and that of outputs from its first
    /// paragraph.
    pub fn with_documentation(mut self, documentation: &[Attribute], variables: &Variables) -> Self {
        let lines = lines(documentation);
        self.outputs = of_text(&paragraph(&lines));
        for line in &lines {
            let Some((name, unit)) = of_line(line) else { continue };
            if name == "t" {
                self.t = unit;
                continue;
            }
            let Variables { x, z, u, p } = variables;
            let Self { x: of_x, z: of_z, u: of_u, p: of_p, .. } = &mut self;
            for (names, units) in [(x, of_x), (z, of_z), (u, of_u), (p, of_p)] {
                units.resize(names.len(), String::new());
                let meant = names.iter().zip(units).filter(|(variable, _)| name_matches(name, variable));
                meant.for_each(|(_, to)| to.clone_from(&unit));
            }
        }
        self
    }
}

/// The unit in a doc comment: the text after a comma in its first paragraph, if it is a unit.
pub fn of_attributes(documentation: &[Attribute]) -> String {
    of_text(&paragraph(&lines(documentation)))
}

/// The lines of doc comments.
fn lines(documentation: &[Attribute]) -> Vec<String> {
    let mut lines = Vec::new();
    for attribute in documentation {
        if let Meta::NameValue(doc) = &attribute.meta
            && doc.path.is_ident("doc")
            && let Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) = &doc.value
        {
            lines.extend(text.value().lines().map(|line| line.trim().to_owned()));
        }
    }
    lines
}

fn paragraph(lines: &[String]) -> String {
    let lines = lines.iter().skip_while(|line| line.is_empty()).take_while(|line| !line.is_empty());
    lines.map(String::as_str).collect::<Vec<_>>().join(" ")
}

/// A line of a list: a name, a colon, and a unit or a text with a unit.
fn of_line(line: &str) -> Option<(&str, String)> {
    let item = line.strip_prefix(['-', '*'])?.trim_start();
    let (name, text) = item.split_once(':')?;
    let name = name.trim_end().trim_matches('`');
    let whole = text.trim().trim_end_matches('.');
    let unit = if is_unit(whole) { whole.to_owned() } else { of_text(text) };
    (!unit.is_empty()).then_some((name, unit))
}

/// The text after a comma, if it is a unit.
fn of_text(text: &str) -> String {
    let parts = text.split(',').skip(1);
    let units = parts.map(|part| {
        let end = part.find([';', ':', '(']).unwrap_or(part.len());
        let part = &part[..end];
        let end = part.find(". ").unwrap_or(part.len());
        part[..end].trim().trim_end_matches('.').trim_matches('`')
    });
    units.into_iter().find(|unit| is_unit(unit)).unwrap_or_default().to_owned()
}

/// Whether a name of a list denotes a variable, as in `casados::ocp`: `x` all states, `x.cart`
/// everything in it.
fn name_matches(name: &str, variable: &str) -> bool {
    let rest = |variable: &str| {
        variable.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with(['[', '.']))
    };
    let field = ["x.", "z.", "u.", "p."].iter().find_map(|argument| variable.strip_prefix(argument));
    rest(variable) || field.is_some_and(rest)
}

/// Units with a name that takes a prefix.
const UNITS_WITH_PREFIX: [&str; 27] = [
    "m", "g", "s", "A", "K", "mol", "cd", "rad", "sr", "Hz", "N", "Pa", "J", "W", "C", "V", "F", "Ω", "Ohm",
    "S", "Wb", "T", "H", "lm", "L", "bar", "eV",
];
/// Units without a prefix.
const UNITS_WITHOUT_PREFIX: [&str; 12] =
    ["%", "‰", "°", "°C", "deg", "min", "h", "d", "rpm", "ha", "Bq", "1"];
const PREFIXES: [&str; 11] = ["p", "n", "µ", "μ", "u", "m", "c", "d", "k", "M", "G"];

/// Products and quotients of powers of units: `m/s²`, `kg m^2`, `W/(m² K)`, `1/s`.
fn is_unit(text: &str) -> bool {
    let mut factors =
        text.split([' ', '·', '*', '/', '(', ')']).filter(|factor| !factor.is_empty()).peekable();
    let begins = |c: char| c.is_alphanumeric() || "°%‰".contains(c);
    factors.peek().is_some() && text.starts_with(begins) && factors.all(is_power)
}

/// A unit with or without an exponent.
fn is_power(factor: &str) -> bool {
    let digits = |c: char| c.is_ascii_digit() || "⁰¹²³⁴⁵⁶⁷⁸⁹⁻".contains(c);
    match factor.split_once('^') {
        Some((base, exponent)) => is_base(base) && exponent.parse::<i8>().is_ok(),
        None if factor == "1" => true,
        None => is_base(factor.trim_end_matches(digits)),
    }
}

fn is_base(base: &str) -> bool {
    let prefixed = |prefix| base.strip_prefix(prefix).is_some_and(|rest| UNITS_WITH_PREFIX.contains(&rest));
    UNITS_WITHOUT_PREFIX.contains(&base)
        || UNITS_WITH_PREFIX.contains(&base)
        || PREFIXES.into_iter().any(prefixed)
}

#[cfg(test)]
mod tests {
    use super::{Units, is_unit, name_matches, of_attributes};
    use crate::language::Variables;
    use syn::parse_quote;

    #[test]
    fn products_of_powers_are_units() {
        for unit in [
            "m",
            "m/s",
            "m/s²",
            "kg m^2",
            "W/(m² K)",
            "1/s",
            "s⁻¹",
            "%",
            "°C",
            "rad/s",
            "kPa",
            "µm",
            "N·m",
            "mol/L",
        ] {
            assert!(is_unit(unit), "{unit}");
        }
        for other in ["", "clockwise", "from the left", "as", "x", "/s", "m above", "10", "m^x", "2"] {
            assert!(!is_unit(other), "{other}");
        }
    }

    #[test]
    fn a_unit_stands_behind_a_comma_of_the_first_paragraph() {
        let of = |attribute: syn::Attribute| of_attributes(&[attribute]);
        assert_eq!(of(parse_quote!(#[doc = " Position, m."])), "m");
        assert_eq!(of(parse_quote!(#[doc = " Angle, from below, rad; clockwise."])), "rad");
        assert_eq!(of(parse_quote!(#[doc = " Heat flow through the wall, W (outwards)"])), "W");
        assert_eq!(of(parse_quote!(#[doc = " Speed, along the wing, that is.\n\n In a lake, m."])), "");
        assert_eq!(of(parse_quote!(#[doc = " Masses m, at most"])), "");
    }

    #[test]
    fn a_list_names_variables() {
        assert!(
            name_matches("x", "x[0]")
                && name_matches("cart", "x.cart.place")
                && !name_matches("x[1]", "x[10]")
        );
        let documentation: [syn::Attribute; 1] = [parse_quote!(
            #[doc = " A cart, pushed.\n\n - `x[0]`: position, m\n - `x[1]`: m/s.\n * u: force, kN\n - `t`: s"]
        )];
        let names = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        let variables = Variables { x: names(&["x[0]", "x[1]"]), u: names(&["u"]), ..Default::default() };
        let units = Units::default().with_documentation(&documentation, &variables);
        assert_eq!((units.x, units.u, units.t.as_str()), (names(&["m", "m/s"]), names(&["kN"]), "s"));
    }
}
