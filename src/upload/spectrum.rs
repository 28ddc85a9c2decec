//! The band of wavelengths of a frame in spectral rendering (shaders/lib/spectrum.glsl).
//!
//! Read pbrt (4th ed.), chapter 4; Jakob and Hanika 2019, "A Low-Dimensional Function Space for Efficient Spectral
//! Upsampling"; docs/decisions/spectra.md.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{Buffer, Device, NOTHING, Place};
use crate::scene::wavelengths::Slice;
use crate::shader::lib;
use crate::spectra::{Band, Grid, RGB_FROM_XYZ, shares};

/// Texels before the grid.
const HEADER: usize = lib::spectrum::GRID_AT as usize;

/// Conversion of RGB colours to a band of wavelengths; a dummy texel for RGB rendering.
pub struct SpectrumOnDevice {
    /// Header and grid, in the layout of shaders/lib/spectrum.glsl.
    pub texels: Buffer,
    grid: Option<&'static Grid>,
    /// Averaged grid texels of the bands that were uploaded before, so that each band is averaged once.
    known: Vec<(Band, Vec<[f32; 4]>)>,
}

/// Specialization constants of all programs that read colours.
#[derive(Debug, Clone, Copy, Default)]
pub struct SpectrumConstants {
    /// Spectral rendering: one frame per band of wavelengths.
    pub spectral: bool,
    /// Grid points per side of the upsampling grid; 0 without a grid.
    pub grid_side: u32,
}

impl SpectrumOnDevice {
    /// Buffers for spectral or RGB rendering, with an upsampling grid if `fitted`: reflectances of textures or vertex
    /// colours are then fitted sigmoids.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, spectral: bool, fitted: bool) -> Result<Self> {
        let grid = (spectral && fitted).then(Grid::fitted);
        let cells = grid.as_ref().map_or(0, |grid| (grid.side - 1) * (grid.side - 1) * grid.side) as usize;
        let (name, texels) = if spectral { ("spectrum", HEADER + cells) } else { (NOTHING, 0) };
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let texels = Buffer::texels(device, name, 16 * texels as u64, Place::Upload, format)?;
        Ok(Self { texels, grid, known: Vec::new() })
    }

    /// The specialization constants for this spectrum.
    #[must_use]
    pub fn constants(&self, spectral: bool) -> SpectrumConstants {
        SpectrumConstants { spectral, grid_side: self.grid.as_ref().map_or(0, |grid| grid.side) }
    }

    /// Uploads the conversion of RGB colours to a slice of wavelengths.
    pub fn upload_band(&mut self, slice: &Slice) {
        let band = &slice.band;
        let column = |v: [f64; 3]| [v[0] as f32, v[1] as f32, v[2] as f32, 0.0];
        let [mut red, green, blue] = slice.light_from_rgb.map(column);
        red[3] = slice.part.middle() as f32;
        self.texels.write_at(0, bytemuck::cast_slice(&[red, green, blue, column(shares(band))]));
        let Some(grid) = self.grid else { return };
        if !self.known.iter().any(|(known, _)| known == band) {
            self.known.push((*band, cells(grid.side, &grid.roots(band))));
        }
        let cells = self.known.iter().find(|(known, _)| known == band).map_or(&[][..], |(_, cells)| cells);
        self.texels.write_at(16 * HEADER, bytemuck::cast_slice(cells));
    }
}

/// The grid's cells: each texel holds the four corners of a cell's face with the smaller blue.
fn cells(side: u32, corners: &[f32]) -> Vec<[f32; 4]> {
    let at = |r: u32, g: u32, b: u32| corners[((b * side + g) * side + r) as usize];
    let mut cells = Vec::with_capacity((side * (side - 1) * (side - 1)) as usize);
    for b in 0..side {
        for g in 0..side - 1 {
            for r in 0..side - 1 {
                cells.push([at(r, g, b), at(r + 1, g, b), at(r, g + 1, b), at(r + 1, g + 1, b)]);
            }
        }
    }
    cells
}

/// Columns of the matrix from CIE XYZ to linear Rec. 709.
#[must_use]
pub fn rgb_from_xyz() -> [[f32; 3]; 3] {
    std::array::from_fn(|column| std::array::from_fn(|row| RGB_FROM_XYZ[row][column] as f32))
}
