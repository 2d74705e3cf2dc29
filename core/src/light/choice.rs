//! Owns all lights of a scene and the choice among them.

use super::along::Beacons;
use super::emitter::Balls;
use super::tree::{Cut, Tree, View};
use super::{Light, Receiver};
use crate::math::Aabb;
use glam::Vec3;

/// All lights of a scene and the choice among them.
///
/// Few lights are all weighed by what each might bring to the receiver. Of many, those at a finite distance form a
/// tree that is walked down, and those at infinity stand beside it.
#[derive(Debug, Clone, Default)]
pub struct Lights {
    pub(super) all: Vec<Light>,
    /// Few lights, eight at a time.
    few: Vec<Balls>,
    /// Numbers of the lights that are weighed by themselves: those at infinity, and spotlights.
    exact: Vec<u32>,
    /// Numbers of the lights at infinity.
    pub(super) infinite: Vec<u32>,
    /// Over many lights.
    pub(super) tree: Option<Tree>,
    /// Whether there is one light only, at a finite distance and not black.
    is_alone: bool,
    /// Squared distance below which lights do not gain weight, so that weights stay finite.
    nearest2: f32,
    /// Those at a finite distance, as media see them.
    pub(super) beacons: Beacons,
}

impl Lights {
    /// Up to this many lights are all weighed at every receiver.
    pub const WEIGH_ALL: usize = 64;

    /// Least probability of the tree and of the lights at infinity where both might bring something: the tree's root
    /// is a rough guess.
    const LEAST_SHARE: f32 = 1.0 / 16.0;

    /// The lights of a scene with these bounds.
    pub fn new(lights: Vec<Light>, scene: &Aabb) -> Self {
        let emitters: Vec<_> = lights.iter().map(Light::emitter).collect();
        let numbers =
            |of: &dyn Fn(usize) -> bool| (0..lights.len() as u32).filter(|&i| of(i as usize)).collect();
        let is_exact = |i: usize| emitters[i].is_none() || matches!(lights[i], Light::Spotlight(_));
        let size2 = if scene.is_empty() { 0.0 } else { scene.size().length_squared() };
        let many = lights.len() > Self::WEIGH_ALL;
        Self {
            few: if many { Vec::new() } else { emitters.chunks(8).map(Balls::new).collect() },
            exact: numbers(&is_exact),
            infinite: numbers(&|i| emitters[i].is_none()),
            tree: many.then(|| Tree::new(&emitters, is_exact)),
            nearest2: (size2 * 1e-14).clamp(1e-30, 1e30),
            is_alone: matches!(&emitters[..], [Some(emitter)] if emitter.intensity > 0.0),
            beacons: Beacons::new(&lights),
            all: lights,
        }
    }

    /// Whether it is dark.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The lights, by number.
    pub fn all(&self) -> &[Light] {
        &self.all
    }

    /// Whether there is nothing to choose: one light only, at a finite distance and not black.
    #[inline]
    pub fn is_alone(&self) -> bool {
        self.is_alone
    }

    /// Chooses a light for a receiver by `u` in [0, 1): its number and the probability of the choice. `None` where no
    /// light would bring anything; a bright one that is alone at a finite distance is always chosen.
    pub fn choose(&self, from: &Receiver, u: f32) -> Option<(usize, f32)> {
        if self.is_alone {
            // What it brings is known when it is sampled.
            return Some((0, 1.0));
        }
        let Some(tree) = &self.tree else { return self.choose_of_few(from, u) };
        let view = self.view(from);
        let cut = tree.cut(&view);
        let (share, beside) = self.tree_share(&cut, &view);
        if u < share {
            return tree.choose(&view, &cut, f64::from(u) / f64::from(share)).map(|(i, p)| (i, p * share));
        }
        let numbers = self.infinite.iter().map(|&i| i as usize);
        let weights = numbers.map(|i| (i, self.importance(i, from)));
        pick(weights, (u - share) / (1.0 - share) * beside).map(|(i, w)| (i, (1.0 - share) * w / beside))
    }

    /// Probability with which [`Lights::choose`] takes a light.
    pub fn choice_pdf(&self, from: &Receiver, index: usize) -> f32 {
        if self.is_alone {
            return 1.0;
        }
        let Some(tree) = &self.tree else {
            let (weights, total) = self.importances(from);
            return if total > 0.0 { weights[index] / total } else { 0.0 };
        };
        let view = self.view(from);
        let cut = tree.cut(&view);
        let (share, beside) = self.tree_share(&cut, &view);
        let at_infinity = matches!(self.all[index], Light::Sun(_) | Light::Environment(_));
        if !at_infinity {
            if share > 0.0 { tree.choice_pdf(&view, &cut, index) * share } else { 0.0 }
        } else if share < 1.0 && beside > 0.0 {
            (1.0 - share) * self.importance(index, from) / beside
        } else {
            0.0
        }
    }

    /// Whether there are lights at infinity.
    pub fn has_infinite(&self) -> bool {
        !self.infinite.is_empty()
    }

    /// Chooses a light at infinity by `u`: its number and the probability of the choice. `None` without any.
    pub fn choose_infinite(&self, from: &Receiver, u: f32) -> Option<(usize, f32)> {
        let weights = self.infinite.iter().map(|&i| (i as usize, self.importance(i as usize, from)));
        let total: f32 = weights.clone().map(|(_, weight)| weight).sum();
        pick(weights, u * total).map(|(light, weight)| (light, weight / total))
    }

    /// Probability with which [`Lights::choose_infinite`] takes a light.
    pub fn infinite_pdf(&self, from: &Receiver, index: usize) -> f32 {
        let total = self.infinite_total(from);
        if total > 0.0 { self.importance(index, from) / total } else { 0.0 }
    }

    /// What all lights at infinity may bring to a receiver.
    pub(super) fn infinite_total(&self, from: &Receiver) -> f32 {
        self.infinite.iter().map(|&i| self.importance(i as usize, from)).sum()
    }

    /// Lights at infinity along a ray that leaves the scene: number, radiance, and the density per solid angle of
    /// having sampled `d`; the choice of the light is not in it.
    pub fn infinite(&self, d: Vec3) -> impl Iterator<Item = (usize, Vec3, f32)> {
        self.infinite.iter().filter_map(move |&i| {
            let (radiance, pdf) = match &self.all[i as usize] {
                Light::Sun(l) => l.seen(d)?,
                Light::Environment(l) => l.seen(d)?,
                Light::Triangle(_)
                | Light::Rectangle(_)
                | Light::Sphere(_)
                | Light::Unsampled(_)
                | Light::Point(_)
                | Light::Spotlight(_) => return None,
            };
            Some((i as usize, radiance, pdf))
        })
    }

    /// What light `index` (a surface) sends from its point `q`, whose front has the geometric normal `ng`, back along
    /// the unit direction `d` from `from` to `q`: radiance, and the density per solid angle of having sampled it; the
    /// choice of the light is not in it. `None` from behind, and where there is no light of this number.
    pub fn emitted(&self, index: usize, from: Vec3, q: Vec3, ng: Vec3, d: Vec3) -> Option<(Vec3, f32)> {
        if d.dot(ng) >= 0.0 {
            return None;
        }
        match self.all.get(index)? {
            Light::Triangle(l) => Some((l.radiance(), l.pdf(from, q))),
            Light::Rectangle(l) => Some((l.radiance(), l.pdf(from, q))),
            Light::Sphere(l) => Some((l.radiance, l.pdf(from))),
            Light::Unsampled(radiance) => Some((*radiance, 0.0)),
            Light::Point(_) | Light::Spotlight(_) | Light::Sun(_) | Light::Environment(_) => None,
        }
    }

    /// What a light that is weighed by itself might bring to a receiver, unoccluded; 0 only where it brings nothing.
    fn importance(&self, index: usize, from: &Receiver) -> f32 {
        let weight = match &self.all[index] {
            Light::Spotlight(l) => l.importance(from, self.nearest2),
            Light::Sun(l) => l.importance(from),
            Light::Environment(l) => l.importance(),
            Light::Triangle(_)
            | Light::Rectangle(_)
            | Light::Sphere(_)
            | Light::Unsampled(_)
            | Light::Point(_) => 0.0,
        };
        if weight.is_finite() { weight } else { 0.0 }
    }

    pub(super) fn view<'a>(&'a self, from: &'a Receiver) -> View<'a, impl Fn(usize) -> f32> {
        View { from, nearest2: self.nearest2, exact: |index| self.importance(index, from) }
    }

    /// Probability of the tree beside the lights at infinity, and the weight of the latter.
    fn tree_share<F: Fn(usize) -> f32>(&self, cut: &Cut, view: &View<'_, F>) -> (f32, f32) {
        if self.infinite.is_empty() {
            return (1.0, 0.0);
        }
        let beside: f32 = self.infinite.iter().map(|&i| (view.exact)(i as usize)).sum();
        let tree = cut.total() as f32;
        let share = if tree > 0.0 && beside > 0.0 {
            (tree / (tree + beside)).clamp(Self::LEAST_SHARE, 1.0 - Self::LEAST_SHARE)
        } else if tree > 0.0 {
            1.0
        } else {
            0.0
        };
        (share, beside)
    }

    /// The weights of few lights, and their sum.
    pub(super) fn importances(&self, from: &Receiver) -> ([f32; Self::WEIGH_ALL], f32) {
        let mut weights = [0.0; Self::WEIGH_ALL];
        for (weights, balls) in weights.chunks_exact_mut(8).zip(&self.few) {
            weights.copy_from_slice(&balls.importance(from, self.nearest2).0);
        }
        for &index in &self.exact {
            weights[index as usize] = self.importance(index as usize, from);
        }
        (weights, weights[..self.all.len()].iter().sum())
    }

    fn choose_of_few(&self, from: &Receiver, u: f32) -> Option<(usize, f32)> {
        let (weights, total) = self.importances(from);
        pick(weights.into_iter().enumerate().take(self.all.len()), u * total).map(|(i, w)| (i, w / total))
    }
}

/// The item at `rest` along the weights laid end to end; never one of weight 0.
pub(super) fn pick(weights: impl Iterator<Item = (usize, f32)>, mut rest: f32) -> Option<(usize, f32)> {
    let mut chosen = None;
    for (index, weight) in weights {
        if weight > 0.0 {
            chosen = Some((index, weight));
            if rest < weight {
                break;
            }
            rest -= weight;
        }
    }
    chosen
}
