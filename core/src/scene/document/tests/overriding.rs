//! Owns the tests of overrides.

use super::{frame, scene};
use crate::film::Region;
use crate::scene::document::{Crop, Description, ErrorOf, Goal, Limits, Overrides, Sampling};

fn with(rest: &str, overrides: &Overrides) -> Result<Description, String> {
    let mut description = frame(&scene(rest));
    let before = description.clone();
    match description.apply(overrides, &Limits::default()) {
        Ok(()) => Ok(description),
        Err(problems) => {
            assert_eq!(description, before);
            Err(problems.to_string())
        }
    }
}

#[test]
fn they_change_what_they_name() {
    let fixed = r#""sampling":{"spp":16,"seed":3}"#;
    let error = r#""sampling":{"target_error":0.1,"min_spp":8,"max_spp":99,"time_limit":5}"#;
    let none = Overrides::default();
    let goal = |rest: &str, overrides: &Overrides| with(rest, overrides).unwrap().sampling.goal;
    assert_eq!(with(fixed, &none).unwrap(), frame(&scene(fixed)));
    assert_eq!(with(error, &none).unwrap(), frame(&scene(error)));
    assert_eq!(goal(error, &Overrides { spp: Some(4), ..none.clone() }), Goal::Fixed { spp: 4 });
    let target = Overrides { target_error: Some(0.2), ..none.clone() };
    assert_eq!(
        goal(fixed, &target),
        Goal::Error { target: 0.2, min_spp: 32, max_spp: 1024, of: ErrorOf::Noisy }
    );
    assert_eq!(
        goal(error, &target),
        Goal::Error { target: 0.2, min_spp: 8, max_spp: 99, of: ErrorOf::Noisy }
    );
    let denoised = Overrides { error_of: Some(ErrorOf::Denoised), ..target.clone() };
    let of = |goal| matches!(goal, Goal::Error { of: ErrorOf::Denoised, .. });
    assert!(of(goal(fixed, &denoised)) && of(goal(error, &denoised)) && !of(goal(error, &target)));
    let said = r#""sampling":{"target_error":0.1,"error_of":"denoised"}"#;
    assert!(of(goal(said, &none)) && of(goal(said, &target)));
    assert_eq!(goal(said, &Overrides { spp: Some(4), ..none.clone() }), Goal::Fixed { spp: 4 });
    let stray = with(fixed, &Overrides { error_of: Some(ErrorOf::Denoised), ..none.clone() }).unwrap_err();
    assert!(stray.contains("sampling.error_of: has a meaning only with \"target_error\""), "{stray}");
    let least = Overrides { min_spp: Some(2), ..none.clone() };
    assert_eq!(goal(error, &least), Goal::Error { target: 0.1, min_spp: 2, max_spp: 99, of: ErrorOf::Noisy });
    let more = Overrides { seed: Some(7), time_limit: Some(1.5), ..none.clone() };
    let expected = Sampling { goal: Goal::Fixed { spp: 16 }, seed: 7, time_limit: Some(1.5) };
    assert_eq!(with(fixed, &more).unwrap().sampling, expected);
    let film =
        Overrides { size: Some((100, 50)), crop: Some(Region { x0: 10, y0: 20, x1: 40, y1: 50 }), ..none };
    let film = with("", &film).unwrap().film;
    assert_eq!((film.width, film.height), (100, 50));
    assert_eq!(film.crop, Some(Crop { x: 10, y: 20, width: 30, height: 30 }));
}

#[test]
fn they_get_the_problems_of_the_document() {
    let none = Overrides::default();
    for (overrides, expected) in [
        (
            Overrides { spp: Some(0), size: Some((0, 70_000)), ..none.clone() },
            "overrides: sampling.spp: found 0, expected an integer from 1 to 16777216\n\
             overrides: film.width: found 0, expected an integer from 1 to 65536\n\
             overrides: film.height: found 70000, expected an integer from 1 to 65536",
        ),
        (
            Overrides { size: Some((65_536, 65_536)), ..none.clone() },
            "overrides: film: found 65536 x 65536 = 4294967296 pixels, the limit is 268435456",
        ),
        (
            Overrides { spp: Some(1), target_error: Some(0.1), ..none.clone() },
            "overrides: sampling.spp: found together with \"target_error\", expected one of them\n  \
             hint: with \"target_error\" use \"min_spp\" and \"max_spp\"",
        ),
        (
            Overrides { max_spp: Some(1), ..none.clone() },
            "overrides: sampling.max_spp: has a meaning only with \"target_error\"\n  \
             hint: give \"target_error\" too, or \"spp\" instead",
        ),
        (
            Overrides { target_error: Some(f64::NAN), ..none.clone() },
            "overrides: sampling.target_error: found NaN, expected a finite number",
        ),
        (
            Overrides { crop: Some(Region { x0: 4, y0: 4, x1: 9, y1: 6 }), ..none },
            "overrides: film.crop: found a crop to (9, 6) of a film of 8 x 6",
        ),
    ] {
        assert_eq!(with("", &overrides).unwrap_err(), expected);
    }
}
