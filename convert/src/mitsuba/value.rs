//! Owns the little languages of attributes: numbers, lists of numbers, truth values, names.

/// The parts of a list, between commas and white space.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty())
}

/// A finite number.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let number: f64 = text.trim().parse().map_err(|_| format!("found {text:?}, expected a number"))?;
    if number.is_finite() { Ok(number) } else { Err(format!("found {text:?}, expected a finite number")) }
}

/// A list of finite numbers.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    words(text).map(number).collect()
}

/// One number for all three, or three numbers.
pub(super) fn triple(text: &str) -> Result<[f64; 3], String> {
    match numbers(text)?[..] {
        [one] => Ok([one; 3]),
        [x, y, z] => Ok([x, y, z]),
        _ => Err(format!("found {text:?}, expected one or three numbers")),
    }
}

/// A whole number; `64.0` is one too.
pub(super) fn integer(text: &str) -> Result<i64, String> {
    let text = text.trim();
    if let Ok(integer) = text.parse() {
        return Ok(integer);
    }
    let wrong = || format!("found {text:?}, expected a whole number");
    let number = number(text).map_err(|_| wrong())?;
    // Whole numbers up to 2^53 are exact.
    if number.fract() == 0.0 && number.abs() <= 9.0e15 { Ok(number as i64) } else { Err(wrong()) }
}

/// `true` or `false`.
pub(super) fn flag(text: &str) -> Result<bool, String> {
    match text.trim().to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        _ => Err(format!("found {text:?}, expected true or false")),
    }
}

/// The spelling of version 3: `toWorld` is `to_world`, `intIOR` is `int_ior`.
pub(super) fn snake(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    let mut before = ' ';
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_ascii_lowercase() {
            out.push('_');
        }
        let within = c.is_ascii_uppercase() && out.contains('_');
        out.push(if within { c.to_ascii_lowercase() } else { c });
        before = c;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{flag, integer, number, snake, triple};

    #[test]
    fn lists_take_commas_and_spaces() {
        assert_eq!(triple("800, 800, 800"), Ok([800.0; 3]));
        assert_eq!(triple(" 1,2\n\t3 "), Ok([1.0, 2.0, 3.0]));
        assert_eq!(triple(".5"), Ok([0.5; 3]));
        assert!(triple("1 2").is_err() && triple("").is_err() && triple("1 a 2").is_err());
    }

    #[test]
    fn numbers_keep_every_bit() {
        for text in ["0.1", "-1.2246468e-22", "39.3077", "1.39626e-07", "5e-324"] {
            assert_eq!(number(text).map(f64::to_bits), Ok(text.parse::<f64>().unwrap().to_bits()));
        }
        assert!(number("nan").is_err() && number("1e999").is_err() && number("1.0f").is_err());
    }

    #[test]
    fn whole_numbers_and_truth_values() {
        assert_eq!((integer("-1"), integer(" 64.0 ")), (Ok(-1), Ok(64)));
        assert!(integer("1.5").is_err() && integer("1e300").is_err() && integer("").is_err());
        assert_eq!((flag("True"), flag("false")), (Ok(true), Ok(false)));
        assert!(flag("yes").is_err());
    }

    #[test]
    fn names_are_spelt_as_in_version_3() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("fovAxis", "fov_axis"),
            ("diffuseReflectance", "diffuse_reflectance"),
            ("specularTransmission", "specular_transmission"),
            ("clearcoatGloss", "clearcoat_gloss"),
            ("alphaU", "alpha_u"),
            ("to_world", "to_world"),
            ("p0", "p0"),
            ("k", "k"),
            ("", ""),
        ] {
            assert_eq!(snake(old), new);
        }
    }
}
