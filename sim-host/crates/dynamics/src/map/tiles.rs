//! The tiles of a map, each in a file that is complete or not there.
//!
//! A tile's file is a line with the CRC-32 of all below it, a line of JSON with the tile's number
//! and the whole plan, and the rows of its cells as CSV. What one run leaves, another continues
//! from; what several machines make is put together. A file with one byte changed is refused, and
//! so is a plan or a cell that is none, whatever its check sum: no count of a plan is believed
//! before the plan is checked.

use super::cell::{Cell, InvalidCell, cells};
use super::plan::{CELLS_A_TILE, Place, Plan, PlanError};
use crate::sweep::RunControl;
use files::input;
use files::output::{WriteError, make_folder, write_text};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};

/// Missing tiles that a message names.
const NAMED: usize = 10;
/// What the first line says before the check sum.
const CHECKSUM_KEY: &str = "crc32 ";
const CHECKSUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
/// Longest file of a tile, bytes: longest plan, and rows of the longest numbers.
const MOST_BYTES: u64 = 64 * 1024 + 512 * CELLS_A_TILE as u64;

/// Tiles cannot be made, kept or put together.
#[derive(Debug, thiserror::Error)]
pub enum TilesError {
    /// The folder cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The folder holds tiles of another plan.
    #[error(
        "{} holds tiles of another map: {differences}; each map needs separate work folders",
        path.display()
    )]
    OtherMap {
        /// The folder.
        path: PathBuf,
        /// The parameters that differ.
        differences: String,
    },
    /// A tile's file cannot be used.
    #[error("cannot use {}; delete it to make it anew", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: InvalidTile,
    },
    /// A tile cannot be computed.
    #[error(transparent)]
    Unsupported(#[from] engine::taylor::Unsupported),
    /// A tile cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The folder has no tiles.
    #[error("{} has no tiles", .0.display())]
    NoTiles(PathBuf),
    /// Tiles are missing.
    #[error(
        "{missing} of {tiles} tiles are missing: {first}; repeat the `map` command of each --shard with its --work, \
         which computes only missing tiles, then merge all work folders"
    )]
    Missing {
        /// How many.
        missing: usize,
        /// Tiles of the map.
        tiles: usize,
        /// The first of them.
        first: String,
    },
}

/// A file is no tile.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each message is its description")]
pub enum InvalidTile {
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error("it has no check sum")]
    NoChecksum,
    #[error(
        "its check sum does not fit: it was changed by hand, damaged, or made by another version"
    )]
    Checksum,
    #[error("it has no rows")]
    NoRows,
    #[error(transparent)]
    Header(#[from] serde_json::Error),
    #[error("its plan is none")]
    Plan(#[from] PlanError),
    #[error("it is tile {tile} of {tiles}")]
    Number { tile: usize, tiles: usize },
    #[error(transparent)]
    Rows(#[from] csv::Error),
    #[error(transparent)]
    Cell(#[from] InvalidCell),
    #[error("its cells are not complete")]
    Incomplete,
    #[error("it is of another map: {0}")]
    OtherMap(String),
    #[error("it is tile {0}")]
    OtherTile(usize),
}

/// A share of a map's tiles: what one of several machines makes. All shares cost about the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    of: usize,
}

/// Its fraction, in units of 2^-64.
const GOLDEN_RATIO: u64 = 0x9E37_79B9_7F4A_7C15;

impl Shard {
    /// All tiles.
    pub const ALL: Self = Self { index: 1, of: 1 };

    /// By the fraction of the tile's number times the golden ratio, which spreads over the shards
    /// every sequence of tiles: neighbours cost alike, and so do the tiles at one place in all rows.
    fn holds(self, tile: usize) -> bool {
        let fraction = (tile as u64).wrapping_mul(GOLDEN_RATIO);
        let shard = (u128::from(fraction) * self.of as u128) >> 64;
        shard as usize == self.index - 1
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    /// From `i/n`: the `i`-th of `n` shards, counted from 1.
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.map(|(index, of)| (index.parse::<usize>(), of.parse::<usize>()));
        match numbers {
            Some((Ok(index), Ok(of))) if (1..=of).contains(&index) => Ok(Self { index, of }),
            _ => Err("must be i/n with i from 1 to n, for instance 2/4".into()),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Header {
    tile: usize,
    plan: Plan,
}

/// A folder with tiles of one plan.
#[derive(Debug)]
pub struct Folder<'a> {
    path: PathBuf,
    plan: &'a Plan,
}

impl<'a> Folder<'a> {
    /// Opens a folder for the tiles of a plan, and makes it if it is not there.
    ///
    /// # Errors
    /// If it cannot be made, or holds a tile of another plan.
    pub fn make(path: &Path, plan: &'a Plan) -> Result<Self, TilesError> {
        make_folder(path)?;
        Self::open(path, plan)
    }

    /// Opens a folder with tiles of a plan.
    ///
    /// # Errors
    /// If it is not there, or holds a tile of another plan.
    pub fn open(path: &Path, plan: &'a Plan) -> Result<Self, TilesError> {
        let folder = Self {
            path: path.into(),
            plan,
        };
        if let Some(other) = first_tile(path)? {
            let plan = read(&other)?.0.plan;
            if plan != *folder.plan {
                return Err(TilesError::OtherMap {
                    path: path.into(),
                    differences: plan.differences(folder.plan).join(", "),
                });
            }
        }
        Ok(folder)
    }

    /// Computes the tiles of a shard that are not there yet, several at once, and keeps each as
    /// soon as it is done. Those not begun when it is asked to stop are left out.
    ///
    /// # Errors
    /// If a tile cannot be computed or written.
    pub fn fill(&self, shard: Shard, control: RunControl) -> Result<(), TilesError> {
        let make = |&tile: &usize| self.write(tile, &cells(self.plan, &self.plan.places(tile))?);
        let made = control.points(&self.missing(shard), make);
        made.into_iter().flatten().collect()
    }

    /// Tiles of a shard that are not there.
    pub fn missing(&self, shard: Shard) -> Vec<usize> {
        let tiles = (0..self.plan.tiles()).filter(|&tile| shard.holds(tile));
        tiles.filter(|&tile| !self.file(tile).exists()).collect()
    }

    fn file(&self, tile: usize) -> PathBuf {
        self.path.join(file_name(tile))
    }

    fn write(&self, tile: usize, cells: &[Cell]) -> Result<(), TilesError> {
        let text = text(tile, self.plan, cells);
        Ok(write_text(&self.file(tile), &text, true)?)
    }

    fn read(&self, tile: usize) -> Result<Vec<Cell>, TilesError> {
        let file = self.file(tile);
        let (header, cells) = read(&file)?;
        let own = if header.plan != *self.plan {
            let differences = header.plan.differences(self.plan).join(", ");
            Err(InvalidTile::OtherMap(differences))
        } else if header.tile != tile {
            Err(InvalidTile::OtherTile(header.tile))
        } else {
            Ok(cells)
        };
        own.map_err(|source| unusable(&file, source))
    }
}

fn unusable(file: &Path, source: InvalidTile) -> TilesError {
    let path = file.into();
    TilesError::Unusable { path, source }
}

/// A tile as its file has it.
#[doc(hidden)]
pub fn text(tile: usize, plan: &Plan, cells: &[Cell]) -> String {
    let plan = plan.clone();
    let header = serde_json::to_string(&Header { tile, plan }).expect("a plan is plain data");
    let mut csv = csv::Writer::from_writer(Vec::new());
    for cell in cells {
        csv.serialize(cell).expect("a cell is a row of plain data");
    }
    let rows = csv.into_inner().expect("a vector takes all rows");
    let rows = String::from_utf8(rows).expect("rows are text");
    sealed(&format!("{header}\n{rows}"))
}

/// A text after its check sum.
fn sealed(text: &str) -> String {
    format!(
        "{CHECKSUM_KEY}{:08x}\n{text}",
        CHECKSUM.checksum(text.as_bytes())
    )
}

/// A file with its check sum made right: for those that test what follows it.
#[doc(hidden)]
pub fn resealed(tile: &str) -> String {
    sealed(tile.split_once('\n').map_or("", |(_, text)| text))
}

fn read(file: &Path) -> Result<(Header, Vec<Cell>), TilesError> {
    let text = input::read_text(file, MOST_BYTES).map_err(InvalidTile::Io);
    let tile = text.and_then(|text| parse(&text));
    tile.map_err(|source| unusable(file, source))
}

/// The plan and the cells in a tile's text.
///
/// # Errors
/// If it is none, a byte of it was changed, or its plan or a cell is none.
#[doc(hidden)]
pub fn parsed(tile: &str) -> Result<(Plan, Vec<Cell>), InvalidTile> {
    parse(tile).map(|(header, cells)| (header.plan, cells))
}

fn parse(tile: &str) -> Result<(Header, Vec<Cell>), InvalidTile> {
    let (_, text) = tile.split_once('\n').ok_or(InvalidTile::NoChecksum)?;
    if tile != sealed(text) {
        return Err(InvalidTile::Checksum);
    }
    let (header, rows) = text.split_once('\n').ok_or(InvalidTile::NoRows)?;
    let header: Header = serde_json::from_str(header)?;
    header.plan.validate()?;
    let (tile, tiles) = (header.tile, header.plan.tiles());
    if tile >= tiles {
        return Err(InvalidTile::Number { tile, tiles });
    }
    let mut reader = csv::Reader::from_reader(rows.as_bytes());
    let cells = reader.deserialize().collect::<Result<Vec<Cell>, _>>()?;
    cells.iter().try_for_each(Cell::validate)?;
    let places: Vec<Place> = cells.iter().map(Cell::place).collect();
    if places != header.plan.places(tile) {
        return Err(InvalidTile::Incomplete);
    }
    Ok((header, cells))
}

/// The plan of the tiles in a folder.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn plan_of(path: &Path) -> Result<Plan, TilesError> {
    let tile = first_tile(path)?.ok_or_else(|| TilesError::NoTiles(path.into()))?;
    Ok(read(&tile)?.0.plan)
}

/// A whole map in the tiles of one or several folders. Tiles are read one at a time, so that memory
/// hardly grows with the map: four bytes per tile.
#[derive(Debug)]
pub struct Merged<'a> {
    folders: &'a [Folder<'a>],
    /// Index of the folder of each tile.
    holders: Vec<u32>,
}

impl<'a> Merged<'a> {
    /// The map of a plan, from folders of its tiles. Of a tile in several folders, that of the first
    /// is taken.
    ///
    /// # Errors
    /// If a tile is in none of them, or a folder cannot be read.
    pub fn new(plan: &Plan, folders: &'a [Folder<'a>]) -> Result<Self, TilesError> {
        const NONE: u32 = u32::MAX;
        let mut holders = vec![NONE; plan.tiles()];
        for (index, folder) in (0..).zip(folders) {
            each_tile(&folder.path, |file| {
                let tile = number(file).and_then(|number| holders.get_mut(number));
                if let Some(holder) = tile.filter(|holder| **holder == NONE) {
                    *holder = index;
                }
            })?;
        }
        let missing = || (0..holders.len()).filter(|&tile| holders[tile] == NONE);
        let count = missing().count();
        if count > 0 {
            let named: Vec<_> = missing().take(NAMED).map(|n| n.to_string()).collect();
            let more = if count > NAMED { ", ..." } else { "" };
            return Err(TilesError::Missing {
                missing: count,
                tiles: holders.len(),
                first: named.join(", ") + more,
            });
        }
        Ok(Self { folders, holders })
    }

    /// All cells in the map's order. An error is the last item.
    pub fn cells(&self) -> impl Iterator<Item = Result<Cell, TilesError>> {
        let read = |(tile, &folder): (usize, &u32)| self.folders[folder as usize].read(tile);
        let tiles = self.holders.iter().enumerate().map(read);
        tiles.flat_map(|tile| {
            let (cells, error) = match tile {
                Ok(cells) => (cells, None),
                Err(error) => (Vec::new(), Some(error)),
            };
            cells.into_iter().map(Ok).chain(error.map(Err))
        })
    }
}

/// The first tile's file of a folder, by name.
fn first_tile(path: &Path) -> Result<Option<PathBuf>, TilesError> {
    let mut first: Option<PathBuf> = None;
    each_tile(path, |file| {
        if first.as_deref().is_none_or(|first| file < first) {
            first = Some(file.into());
        }
    })?;
    Ok(first)
}

/// Calls a function with each tile's file of a folder, in no order.
fn each_tile(path: &Path, mut on_tile: impl FnMut(&Path)) -> Result<(), TilesError> {
    let unreadable = |source| TilesError::Folder {
        path: path.into(),
        source,
    };
    for entry in fs::read_dir(path).map_err(unreadable)? {
        let file = entry.map_err(unreadable)?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("tile-") && name.ends_with(".csv") {
            on_tile(&file);
        }
    }
    Ok(())
}

/// The number of the tile that a file has by its name.
fn number(file: &Path) -> Option<usize> {
    let name = file.file_name()?.to_str()?;
    let number = name.strip_prefix("tile-")?.strip_suffix(".csv")?;
    let number = number.parse().ok()?;
    (file_name(number) == name).then_some(number)
}

fn file_name(tile: usize) -> String {
    format!("tile-{tile:06}.csv")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shards(of: usize) -> Vec<Shard> {
        (1..=of).map(|index| Shard { index, of }).collect()
    }

    #[test]
    fn each_tile_is_in_one_shard() {
        for of in 1..=9 {
            for tile in 0..1000 {
                let holders = shards(of).into_iter().filter(|shard| shard.holds(tile));
                assert_eq!(holders.count(), 1, "tile {tile} of {of} shards");
            }
        }
    }

    /// Of tiles that cost as much as their place in a row says, each shard gets a like share,
    /// whatever the length of a row.
    #[test]
    fn shards_cost_alike() {
        const ROWS: usize = 512;
        for row in [1, 2, 3, 4, 6, 8, 16] {
            for of in 2..=8 {
                let cost = |tile: usize| (1 + tile % row * 10) as f64;
                let all = 0..ROWS * row;
                let fair = all.clone().map(cost).sum::<f64>() / of as f64;
                for shard in shards(of) {
                    let own = all.clone().filter(|&tile| shard.holds(tile));
                    let own = own.map(cost).sum::<f64>() / fair;
                    assert!(
                        (0.97..1.03).contains(&own),
                        "{shard:?}, rows of {row}: {own}"
                    );
                }
            }
        }
    }
}
