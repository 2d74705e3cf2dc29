//! Owns what `karst check` says about objects made of distance functions: what the settings are, and why.

use karst_core::sdf::Sdf;
use serde_json::{Value, json};

/// One sentence for people.
pub(super) fn in_words(sdf: &Sdf) -> String {
    let nodes = sdf.tape().nodes();
    if sdf.is_closed() {
        return format!("{nodes} nodes, met by formula: no settings apply");
    }
    let resolved = sdf.resolved();
    let clamp = resolved.step_clamp;
    let clamped = if clamp.is_finite() { format!(" of {clamp} at most") } else { String::new() };
    let mut words = vec![
        format!("{nodes} nodes, marched in at most {} steps{clamped}", resolved.max_steps),
        match resolved.hit_epsilon {
            Some(given) => format!("features thinner than {} may be skipped", 2.0 * given),
            None => format!(
                "features thinner than half of a pixel's radius may be skipped, and none thicker than {:.3e} (1/2048 of \
                 its size)",
                2.0 * resolved.largest_hit_epsilon
            ),
        },
        match (resolved.normal_epsilon, sdf.normal_reach()) {
            (Some(given), _) => format!("normals over {given}"),
            (None, Some(reach)) => format!(
                "normals over {reach:.3e} (1/64 of a fractal's level, which is where its surface is: a wider reach would \
                 cross creases)"
            ),
            (None, None) => "normals are its gradient".to_owned(),
        },
    ];
    if let Some((cells, steps)) = sdf.cells() {
        words.push(format!("{cells} cells, in which {steps:.0} steps matter on average"));
    }
    words.join("; ")
}

/// The same as numbers; `null` is what follows the pixel.
pub(super) fn as_json(sdf: &Sdf) -> Value {
    let resolved = sdf.resolved();
    json!({
        "nodes": sdf.tape().nodes(),
        "by_formula": sdf.is_closed(),
        "max_steps": resolved.max_steps,
        "step_clamp": resolved.step_clamp.is_finite().then_some(resolved.step_clamp),
        "hit_epsilon": resolved.hit_epsilon,
        "largest_hit_epsilon": resolved.largest_hit_epsilon,
        "normal_epsilon": sdf.normal_reach(),
        "level": sdf.tape().level(),
        "cells": sdf.cells().map(|(cells, _)| cells),
    })
}
