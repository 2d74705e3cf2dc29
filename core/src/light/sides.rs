//! Owns sampling lights at a finite distance and lights at infinity side by side.
//!
//! A choice by what lights may bring knows nothing of what is in their way. In a cave the sun outshines all torches and
//! reaches next to nothing, so that torches would hardly ever be chosen. With both kinds in a scene, one of each is sampled;
//! a kind that could bring next to nothing even unoccluded is left out now and then.

use super::choice::pick;
use super::{Light, Lights, Receiver};

/// A kind of lights that is sampled by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// At a finite distance.
    Near,
    /// At infinity.
    Infinite,
}

impl Side {
    /// That of a light.
    pub fn of(light: &Light) -> Self {
        if light.is_infinite() { Self::Infinite } else { Self::Near }
    }
}

/// Share of all light from which on a kind is always sampled.
const ALWAYS: f32 = 0.02;

/// How often a kind is sampled that may bring `own` of `total`.
fn often(own: f32, total: f32) -> f32 {
    if own > 0.0 { (own / (ALWAYS * total)).min(1.0) } else { 0.0 }
}

impl Lights {
    /// Whether there are lights of both kinds.
    pub fn has_both_sides(&self) -> bool {
        !self.infinite.is_empty() && self.infinite.len() < self.all.len()
    }

    /// Chooses a light of one kind for a receiver by `u` in [0, 1): its number and the probability of the choice. `None`
    /// where none is to be sampled.
    pub fn choose_of(&self, side: Side, from: &Receiver, u: f32) -> Option<(usize, f32)> {
        let Some(tree) = &self.tree else {
            let (weights, total) = self.importances(from);
            let kind = (0..self.all.len()).filter(|&i| Side::of(&self.all[i]) == side);
            let own: f32 = kind.clone().map(|i| weights[i]).sum();
            let often = often(own, total);
            let chosen = if u < often { pick(kind.map(|i| (i, weights[i])), u / often * own) } else { None };
            return chosen.map(|(light, weight)| (light, weight / own * often));
        };
        let view = self.view(from);
        let cut = tree.cut(&view);
        let (near, infinite) = (cut.total() as f32, self.infinite_total(from));
        let own = if side == Side::Near { near } else { infinite };
        let often = often(own, near + infinite);
        if u >= often {
            return None;
        }
        let (light, probability) = match side {
            Side::Near => tree.choose(&view, &cut, f64::from(u) / f64::from(often))?,
            Side::Infinite => self.choose_infinite(from, u / often)?,
        };
        Some((light, probability * often))
    }

    /// Probability with which [`Lights::choose_of`] takes a light among its kind.
    pub fn choice_of_pdf(&self, from: &Receiver, light: usize) -> f32 {
        let side = Side::of(&self.all[light]);
        let Some(tree) = &self.tree else {
            let (weights, total) = self.importances(from);
            let kind = (0..self.all.len()).filter(|&i| Side::of(&self.all[i]) == side);
            let own: f32 = kind.map(|i| weights[i]).sum();
            return if own > 0.0 { weights[light] / own * often(own, total) } else { 0.0 };
        };
        let view = self.view(from);
        let cut = tree.cut(&view);
        let (near, infinite) = (cut.total() as f32, self.infinite_total(from));
        match side {
            Side::Near if near > 0.0 => tree.choice_pdf(&view, &cut, light) * often(near, near + infinite),
            Side::Near => 0.0,
            Side::Infinite => self.infinite_pdf(from, light) * often(infinite, near + infinite),
        }
    }
}
