//! Owns the geometry of a frame: regions in pixels, pixel blocks aligned to the frame, and the tiles that group them.

/// Edge of a pixel block in pixels. Blocks are aligned to the frame, whatever the window or the tile size.
pub const BLOCK: u32 = 16;

/// Width and height of the full frame in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameSize {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl FrameSize {
    /// The whole frame as a region.
    pub fn region(self) -> Region {
        Region { x0: 0, y0: 0, x1: self.width, y1: self.height }
    }
}

/// A half-open rectangle in pixels of the frame; y runs down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Region {
    /// Left edge, inside.
    pub x0: u32,
    /// Top edge, inside.
    pub y0: u32,
    /// Right edge, outside.
    pub x1: u32,
    /// Bottom edge, outside.
    pub y1: u32,
}

impl Region {
    /// Pixels across.
    pub fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Pixels down.
    pub fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width() as usize * self.height() as usize
    }

    /// The pixels that both hold.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let (x0, y0) = (self.x0.max(other.x0), self.y0.max(other.y0));
        Self { x0, y0, x1: self.x1.min(other.x1).max(x0), y1: self.y1.min(other.y1).max(y0) }
    }

    /// Its pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let Self { x0, y0, x1, y1 } = *self;
        (y0..y1).flat_map(move |y| (x0..x1).map(move |x| [x, y]))
    }
}

/// The blocks of a window of the frame, and square tiles that group them.
///
/// Blocks and tiles are numbered row by row over those that touch the window; their regions are clipped to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileGrid {
    window: Region,
    tile_size: u32,
}

impl TileGrid {
    /// A grid over `window`; `tile_size` is rounded up to a multiple of [`BLOCK`] and is at least one block.
    pub fn new(window: Region, tile_size: u32) -> Self {
        Self { window, tile_size: tile_size.clamp(1, 1 << 16).next_multiple_of(BLOCK) }
    }

    /// The pixels that are rendered.
    pub fn window(&self) -> Region {
        self.window
    }

    /// Edge of a tile in pixels.
    pub fn tile_size(&self) -> u32 {
        self.tile_size
    }

    /// Number of tiles.
    pub fn tile_count(&self) -> u32 {
        Cells::new(self.window, self.tile_size).count()
    }

    /// Pixels of a tile.
    pub fn tile_region(&self, tile: u32) -> Region {
        Cells::new(self.window, self.tile_size).region(tile)
    }

    /// Blocks of a tile in increasing order.
    pub fn tile_blocks(&self, tile: u32) -> impl Iterator<Item = u32> + use<> {
        self.blocks_of(self.tile_region(tile))
    }

    /// Blocks that a region touches, in increasing order; the region is clipped to the window.
    pub fn blocks_of(&self, region: Region) -> impl Iterator<Item = u32> + use<> {
        let region = region.intersection(&self.window);
        let region = if region.area() > 0 { region } else { Region { x0: 0, y0: 0, x1: 0, y1: 0 } };
        let blocks = Cells::new(self.window, BLOCK);
        let columns = region.x0 / BLOCK..region.x1.div_ceil(BLOCK);
        (region.y0 / BLOCK..region.y1.div_ceil(BLOCK))
            .flat_map(move |row| columns.clone().map(move |column| blocks.index(column, row)))
    }

    /// Number of blocks.
    pub fn block_count(&self) -> u32 {
        Cells::new(self.window, BLOCK).count()
    }

    /// Number of blocks in a row.
    pub fn block_columns(&self) -> u32 {
        Cells::new(self.window, BLOCK).columns
    }

    /// Pixels of a block.
    pub fn block_region(&self, block: u32) -> Region {
        Cells::new(self.window, BLOCK).region(block)
    }
}

/// Square cells of one size over a window, aligned to the frame.
#[derive(Clone, Copy)]
struct Cells {
    window: Region,
    size: u32,
    first: [u32; 2],
    columns: u32,
    rows: u32,
}

impl Cells {
    fn new(window: Region, size: u32) -> Self {
        let first = [window.x0 / size, window.y0 / size];
        let end = [window.x1.div_ceil(size), window.y1.div_ceil(size)];
        Self {
            window,
            size,
            first,
            columns: end[0].saturating_sub(first[0]),
            rows: end[1].saturating_sub(first[1]),
        }
    }

    fn count(&self) -> u32 {
        self.columns * self.rows
    }

    fn index(&self, column: u32, row: u32) -> u32 {
        (row - self.first[1]) * self.columns + (column - self.first[0])
    }

    fn region(&self, cell: u32) -> Region {
        let x = (self.first[0] + cell % self.columns) * self.size;
        let y = (self.first[1] + cell / self.columns) * self.size;
        Region { x0: x, y0: y, x1: x + self.size, y1: y + self.size }.intersection(&self.window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_and_blocks_cover_every_pixel_of_the_window_once() {
        let windows = [
            Region { x0: 0, y0: 0, x1: 1, y1: 1 },
            Region { x0: 0, y0: 0, x1: 100, y1: 50 },
            Region { x0: 37, y0: 19, x1: 131, y1: 97 },
        ];
        for (window, tile_size) in windows.iter().flat_map(|w| [16, 32, 64, 96, 1000].map(|size| (*w, size)))
        {
            let grid = TileGrid::new(window, tile_size);
            let mut seen = vec![0; window.area()];
            let mut blocks = vec![0; grid.block_count() as usize];
            for tile in 0..grid.tile_count() {
                let regions = grid.tile_blocks(tile).map(|block| {
                    blocks[block as usize] += 1;
                    grid.block_region(block)
                });
                let pixels: Vec<[u32; 2]> = regions.flat_map(|r| r.pixels()).collect();
                assert_eq!(pixels.len(), grid.tile_region(tile).area());
                for [x, y] in pixels {
                    seen[((y - window.y0) * window.width() + x - window.x0) as usize] += 1;
                }
            }
            assert!(seen.iter().all(|&n| n == 1) && blocks.iter().all(|&n| n == 1), "{window:?} {tile_size}");
        }
    }
}
