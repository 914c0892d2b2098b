//! The tiles of a map, each in a file that is complete or not there.
//!
//! A tile's file is a line with the CRC-32 of all below it, a line of JSON with the tile's number and the whole plan, and the rows
//! of its cells as CSV. What one run leaves, another continues from; what several machines make is put together. A file with one
//! byte changed is refused, and so is a plan or a cell that is none, whatever its check sum: no count of a plan is believed
//! before the plan is checked.

use super::cell::{Cell, cells};
use super::plan::{CELLS_A_TILE, Place, Plan};
use crate::bounded;
use crate::chaos::sweep::Watch;
use crate::output::{make_folder, write_text};
use anyhow::{Context, bail, ensure};
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

/// Every `of`-th tile of a map: what one of several machines makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    of: usize,
}

impl Shard {
    /// All tiles.
    pub const ALL: Self = Self { index: 1, of: 1 };

    fn holds(self, tile: usize) -> bool {
        tile % self.of == self.index - 1
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
    pub fn make(path: &Path, plan: &'a Plan) -> anyhow::Result<Self> {
        make_folder(path)?;
        Self::open(path, plan)
    }

    /// Opens a folder with tiles of a plan.
    ///
    /// # Errors
    /// If it is not there, or holds a tile of another plan.
    pub fn open(path: &Path, plan: &'a Plan) -> anyhow::Result<Self> {
        let folder = Self {
            path: path.into(),
            plan,
        };
        if let Some(other) = first_tile(path)? {
            let plan = read(&other)?.0.plan;
            ensure!(
                plan == *folder.plan,
                "{} holds tiles of another map: {}; give another --work, or delete them",
                path.display(),
                plan.differences(folder.plan).join(", ")
            );
        }
        Ok(folder)
    }

    /// Computes the tiles of a shard that are not there yet, several at once, and keeps each as soon as it is done. Those not begun
    /// when it is asked to stop are left out.
    ///
    /// # Errors
    /// If a tile cannot be computed or written.
    pub fn fill(&self, shard: Shard, watch: Watch) -> anyhow::Result<()> {
        let make = |&tile: &usize| self.write(tile, &cells(self.plan, &self.plan.places(tile))?);
        let made = watch.points(&self.missing(shard), make);
        made.into_iter().flatten().collect()
    }

    /// Tiles of a shard that are not there.
    pub fn missing(&self, shard: Shard) -> Vec<usize> {
        let tiles = (0..self.plan.tiles()).filter(|&tile| shard.holds(tile));
        tiles.filter(|&tile| !self.file(tile).exists()).collect()
    }

    fn file(&self, tile: usize) -> PathBuf {
        self.path.join(format!("tile-{tile:06}.csv"))
    }

    fn write(&self, tile: usize, cells: &[Cell]) -> anyhow::Result<()> {
        write_text(&self.file(tile), &text(tile, self.plan, cells)?, true)
    }

    fn read(&self, tile: usize) -> anyhow::Result<Vec<Cell>> {
        let file = self.file(tile);
        let (header, cells) = read(&file)?;
        let is_own = || {
            ensure!(
                header.plan == *self.plan,
                "it is of another map: {}",
                header.plan.differences(self.plan).join(", ")
            );
            ensure!(header.tile == tile, "it is tile {}", header.tile);
            Ok(())
        };
        is_own().with_context(|| unusable(&file))?;
        Ok(cells)
    }
}

fn unusable(file: &Path) -> String {
    format!("cannot use {}; delete it to make it anew", file.display())
}

/// A tile as its file has it.
///
/// # Errors
/// If a cell cannot be written.
#[doc(hidden)]
pub fn text(tile: usize, plan: &Plan, cells: &[Cell]) -> anyhow::Result<String> {
    let plan = plan.clone();
    let header = serde_json::to_string(&Header { tile, plan })?;
    let mut csv = csv::Writer::from_writer(Vec::new());
    for cell in cells {
        csv.serialize(cell)?;
    }
    let rows = String::from_utf8(csv.into_inner()?)?;
    Ok(sealed(&format!("{header}\n{rows}")))
}

/// A text behind its check sum.
fn sealed(text: &str) -> String {
    format!(
        "{CHECKSUM_KEY}{:08x}\n{text}",
        CHECKSUM.checksum(text.as_bytes())
    )
}

/// A file with its check sum made right: for those that test what lies behind it.
#[doc(hidden)]
pub fn resealed(tile: &str) -> String {
    sealed(tile.split_once('\n').map_or("", |(_, text)| text))
}

fn read(file: &Path) -> anyhow::Result<(Header, Vec<Cell>)> {
    let text = bounded::read_text(file, MOST_BYTES);
    let tile = text.map_err(Into::into).and_then(|text| parse(&text));
    tile.with_context(|| unusable(file))
}

/// The plan and the cells in a tile's text.
///
/// # Errors
/// If it is none, a byte of it was changed, or its plan or a cell is none.
#[doc(hidden)]
pub fn parsed(tile: &str) -> anyhow::Result<(Plan, Vec<Cell>)> {
    parse(tile).map(|(header, cells)| (header.plan, cells))
}

fn parse(tile: &str) -> anyhow::Result<(Header, Vec<Cell>)> {
    let (_, text) = tile.split_once('\n').context("it has no check sum")?;
    ensure!(
        tile == sealed(text),
        "its check sum does not fit: it was changed by hand, damaged, or made by another version"
    );
    let (header, rows) = text.split_once('\n').context("it has no rows")?;
    let header: Header = serde_json::from_str(header)?;
    header.plan.validate().context("its plan is none")?;
    let tiles = header.plan.tiles();
    ensure!(header.tile < tiles, "it is tile {} of {tiles}", header.tile);
    let mut reader = csv::Reader::from_reader(rows.as_bytes());
    let cells = reader.deserialize().collect::<Result<Vec<Cell>, _>>()?;
    cells.iter().try_for_each(Cell::validate)?;
    let places: Vec<Place> = cells.iter().map(Cell::place).collect();
    ensure!(
        places == header.plan.places(header.tile),
        "its cells are not complete"
    );
    Ok((header, cells))
}

/// The plan of the tiles in a folder.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn plan_of(path: &Path) -> anyhow::Result<Plan> {
    let tile = first_tile(path)?.with_context(|| format!("{} has no tiles", path.display()))?;
    Ok(read(&tile)?.0.plan)
}

/// All cells of a map from tiles in one or several folders, in the map's order.
///
/// # Errors
/// If a tile is in none of them, or one is of another plan or damaged.
pub fn put_together(folders: &[Folder]) -> anyhow::Result<Vec<Cell>> {
    let plan = folders.first().context("there is no folder")?.plan;
    let holder = |tile| folders.iter().find(|folder| folder.file(tile).exists());
    let all = 0..plan.tiles();
    let missing: Vec<_> = all.clone().filter(|&tile| holder(tile).is_none()).collect();
    if !missing.is_empty() {
        let named: Vec<_> = missing.iter().take(NAMED).map(usize::to_string).collect();
        let more = if missing.len() > NAMED { ", ..." } else { "" };
        bail!(
            "{} of {} tiles are missing: {}{more}",
            missing.len(),
            plan.tiles(),
            named.join(", ")
        );
    }
    let mut cells = Vec::with_capacity(plan.cells());
    for (tile, folder) in all.filter_map(|tile| Some((tile, holder(tile)?))) {
        cells.extend(folder.read(tile)?);
    }
    Ok(cells)
}

/// The first tile's file of a folder, by name.
fn first_tile(path: &Path) -> anyhow::Result<Option<PathBuf>> {
    let entries = fs::read_dir(path).with_context(|| format!("cannot read {}", path.display()))?;
    let files = entries.collect::<Result<Vec<_>, _>>()?;
    let is_tile = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("tile-") && name.ends_with(".csv")
    };
    let files = files.iter().map(fs::DirEntry::path);
    Ok(files.filter(is_tile).min())
}
