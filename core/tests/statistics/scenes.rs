//! Owns scenes for the tests: documents put together from parts, rendered, and the means of their pictures.

use super::support::{render, scene_in};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use karst_core::film::{Film, Picture};
use karst_core::scene::Scene;
use std::path::Path;

/// What a document says beside its surfaces and lights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shot {
    /// Side of the square picture, in pixels.
    pub(crate) side: u32,
    pub(crate) spp: u32,
    pub(crate) seed: u32,
    pub(crate) max_depth: u32,
    pub(crate) roulette_depth: u32,
    pub(crate) vfov: f64,
    pub(crate) eye: DVec3,
    pub(crate) target: DVec3,
    pub(crate) up: DVec3,
}

impl Shot {
    /// From `eye` to the origin.
    pub(crate) fn from(eye: DVec3) -> Self {
        Self {
            side: 16,
            spp: 256,
            seed: 1,
            max_depth: 64,
            roulette_depth: 5,
            vfov: 30.0,
            eye,
            target: DVec3::ZERO,
            up: DVec3::Y,
        }
    }

    /// The document with these members.
    pub(crate) fn document(&self, members: &str) -> String {
        let Self { side, spp, seed, max_depth, roulette_depth, vfov, eye, target, up } = self;
        let [eye, target, up] = [eye, target, up].map(|v| list(*v));
        format!(
            r#"{{"version": 1,
            "camera": {{"type": "perspective", "vfov": {vfov}, "transform": {{"look_at": {{"eye": {eye}, "target": {target}, "up": {up}}}}}}},
            "film": {{"width": {side}, "height": {side}, "filter": {{"type": "box"}}}},
            "sampling": {{"spp": {spp}, "seed": {seed}}},
            "integrator": {{"max_depth": {max_depth}, "roulette_depth": {roulette_depth}}},
            {members}}}"#
        )
    }

    /// Renders it.
    pub(crate) fn take(&self, members: &str) -> Shown {
        self.take_in(Path::new("."), members)
    }

    /// Renders it with assets from a folder.
    pub(crate) fn take_in(&self, folder: &Path, members: &str) -> Shown {
        Shown::of(&self.scene_in(folder, members))
    }

    /// Compiles it.
    pub(crate) fn scene_in(&self, folder: &Path, members: &str) -> Scene {
        scene_in(folder, &self.document(members), 1)
    }

    /// Direction of the ray through the middle of a pixel, as the document describes cameras.
    pub(crate) fn ray(&self, pixel: u32) -> DVec3 {
        let (x, y) = (f64::from(pixel % self.side) + 0.5, f64::from(pixel / self.side) + 0.5);
        let z = (self.eye - self.target).normalize();
        let right = self.up.cross(z).normalize();
        let half = libm::tan(0.5 * self.vfov.to_radians());
        let side = f64::from(self.side);
        (right * (half * (2.0 * x / side - 1.0)) - z.cross(right) * (half * (2.0 * y / side - 1.0)) - z)
            .normalize()
    }
}

/// A vector as the documents write it.
pub(crate) fn list(v: DVec3) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

/// An affine map as the documents write it.
pub(crate) fn matrix(map: &DAffine3) -> String {
    let DAffine3 { matrix3: DMat3 { x_axis: x, y_axis: y, z_axis: z }, translation: t } = *map;
    let row = |at: usize| format!("[{:?}, {:?}, {:?}, {:?}]", x[at], y[at], z[at], t[at]);
    format!(r#"{{"matrix": [{}, {}, {}, [0, 0, 0, 1]]}}"#, row(0), row(1), row(2))
}

/// A rendered picture.
#[derive(Debug)]
pub(crate) struct Shown {
    pub(crate) film: Film,
    pub(crate) picture: Picture,
    /// Mean over pixels and channels.
    pub(crate) mean: f64,
    /// Its standard error, from the difference of the replicates.
    pub(crate) error: f64,
}

impl Shown {
    /// Renders a scene; no sample may be lost.
    pub(crate) fn of(scene: &Scene) -> Self {
        let film = render(scene, 32, 2);
        let counters = film.summary().counters;
        assert_eq!((counters.nan_samples, counters.infinite_samples), (0, 0), "samples that are not finite");
        let picture = film.picture();
        let mean = mean_of(&picture.color);
        // Replicates differ by twice the error of their mean, and their mean over the picture by twice its error: the
        // pixels are independent.
        let rmse = film.summary().rmse.unwrap_or(f64::NAN);
        let error = rmse / (picture.color.len() as f64).sqrt();
        Self { film, picture, mean, error }
    }

    /// Its distance from another picture's mean, in standard errors of both.
    pub(crate) fn apart(&self, other: &Self) -> f64 {
        (self.mean - other.mean) / libm::hypot(self.error, other.error).max(1e-9)
    }
}

/// Mean over pixels and channels.
pub(crate) fn mean_of(colors: &[Vec3]) -> f64 {
    colors.iter().map(|c| f64::from(c.element_sum()) / 3.0).sum::<f64>() / colors.len().max(1) as f64
}
