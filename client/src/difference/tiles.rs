//! Where two pictures differ most.

use super::relative_square;

/// Edge of a tile in pixels, the last column and row may have less.
const EDGE: usize = 16;

/// How many tiles are named.
const NAMED: usize = 5;

/// A part of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tile {
    /// Left edge in pixels.
    pub(crate) x: usize,
    /// Upper edge in pixels, counted from the top.
    pub(crate) y: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rel_mse: f64,
}

/// The tiles with the largest relMSE, the largest first; tiles without a difference are not among them.
pub(crate) fn worst_tiles(a: &[[f32; 3]], b: &[[f32; 3]], width: usize) -> Vec<Tile> {
    let height = a.len() / width.max(1);
    let mut tiles: Vec<Tile> = (0..height)
        .step_by(EDGE)
        .flat_map(|y| (0..width).step_by(EDGE).map(move |x| (x, y)))
        .map(|(x, y)| {
            let (columns, rows) = (EDGE.min(width - x), EDGE.min(height - y));
            let pixels = (y..y + rows).flat_map(|y| (x..x + columns).map(move |x| y * width + x));
            let rel_mse = mean(pixels.map(|index| (a[index].map(f64::from), b[index].map(f64::from))));
            Tile { x, y, width: columns, height: rows, rel_mse }
        })
        .filter(|tile| tile.rel_mse > 0.0)
        .collect();
    tiles.sort_by(|one, other| other.rel_mse.total_cmp(&one.rel_mse));
    tiles.truncate(NAMED);
    tiles
}

/// relMSE of the finite pixels, 0 without any.
fn mean(pixels: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> f64 {
    let (mut sum, mut values) = (0.0, 0.0_f64);
    for (a, b) in pixels.filter(|(a, b)| a.iter().chain(b).all(|x| x.is_finite())) {
        sum += a.into_iter().zip(b).map(|(a, b)| relative_square(a - b, b)).sum::<f64>();
        values += 3.0;
    }
    sum / values.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::{Tile, worst_tiles};

    #[test]
    fn tiles_are_named_by_place_and_figure() {
        let (width, height) = (40, 33);
        let reference = vec![[1.0_f32; 3]; width * height];
        let mut picture = reference.clone();
        let mut set = |x: usize, y: usize, value: f32| picture[y * width + x] = [value; 3];
        // One pixel in each of six tiles, the differences 6, 5, 4, 3, 2 and 1.
        for (x, y, value) in
            [(0, 0, 7.0), (16, 0, 5.0), (39, 0, 6.0), (15, 31, 4.0), (0, 32, 3.0), (39, 32, 2.0)]
        {
            set(x, y, value);
        }
        set(17, 17, f32::NAN);
        let tile = |x, y, width, height, difference: f64| Tile {
            x,
            y,
            width,
            height,
            rel_mse: difference * difference / 1.01 / (width * height) as f64,
        };
        let expected = [
            // The corner tile has 8 pixels, the tile above it 128, the one to the left 16, others 256.
            tile(0, 32, 16, 1, 2.0),
            tile(32, 0, 8, 16, 5.0),
            tile(0, 0, 16, 16, 6.0),
            tile(39 - 7, 32, 8, 1, 1.0),
            tile(16, 0, 16, 16, 4.0),
        ];
        let found = worst_tiles(&picture, &reference, width);
        assert_eq!(found.len(), 5);
        for (found, expected) in found.iter().zip(expected) {
            let figure = (found.rel_mse / expected.rel_mse - 1.0).abs() < 1e-12;
            assert!(
                figure && Tile { rel_mse: 0.0, ..*found } == Tile { rel_mse: 0.0, ..expected },
                "{found:?}"
            );
        }
        assert_eq!(worst_tiles(&reference, &reference, width), []);
    }
}
