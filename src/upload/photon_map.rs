//! The photon map of punctual lights on the device: rays of photons, where they land, and the map of those that did
//! (shaders/lib/photon_map.glsl).
//!
//! [`crate::transport::photon_map`] computes rays and map.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::table::upload;
use crate::gpu::{Buffer, Device, NOTHING, Place};
use crate::share::Landing;
use crate::transport::photon_map::{PhotonEmission, photon_map};

/// The photon map, and what leaves the lights.
pub struct PhotonsOnDevice {
    /// `None` in plans without photons, and where no light sees a smooth surface.
    emission: Option<PhotonEmission>,
    /// Nodes, then photons; a dummy in plans without photons.
    pub map: Buffer,
}

/// A set of photons on its way.
pub struct PhotonFlight {
    /// One [`PhotonRay`](crate::share::PhotonRay) per photon.
    pub rays: Buffer,
    /// One [`Landing`] per photon.
    pub landings: Buffer,
    /// Number of photons.
    pub count: u32,
}

impl PhotonsOnDevice {
    /// An empty map.
    ///
    /// # Errors
    /// When memory is short.
    pub fn new(device: &Arc<Device>, emission: Option<PhotonEmission>) -> Result<Self> {
        Ok(Self { emission, map: map_of(device, &[], 0.0)? })
    }

    /// A dummy for plans without photons.
    ///
    /// # Errors
    /// When memory is short.
    pub fn none(device: &Arc<Device>) -> Result<Self> {
        let map = Buffer::texels(device, NOTHING, 0, Place::Device, vk::Format::R32G32B32A32_UINT)?;
        Ok(Self { emission: None, map })
    }

    /// Uploads the rays of a set of photons; each `number` gives another set.
    ///
    /// # Errors
    /// When memory is short.
    pub fn emit(&self, device: &Arc<Device>, number: u64) -> Result<Option<PhotonFlight>> {
        let rays = self.emission.as_ref().map_or_else(Vec::new, |emission| emission.rays(number));
        let count = rays.len() as u32;
        if count == 0 {
            return Ok(None);
        }
        let bytes = u64::from(count) * size_of::<Landing>() as u64;
        Ok(Some(PhotonFlight {
            rays: upload(device, "rays of photons", &rays, None)?,
            landings: Buffer::new(device, "landings of photons", bytes, Place::Readback)?,
            count,
        }))
    }

    /// Builds the map of a set that was traced. Descriptor sets that bind the old map have to be written again.
    ///
    /// # Errors
    /// When memory is short.
    pub fn land(&mut self, device: &Arc<Device>, flight: &PhotonFlight) -> Result<()> {
        let bytes = flight.count as usize * size_of::<Landing>();
        let landed: Vec<Landing> = flight.landings.read(|all| bytemuck::pod_collect_to_vec(&all[..bytes]));
        self.map = map_of(device, &landed, self.emission.as_ref().map_or(0.0, PhotonEmission::radius))?;
        Ok(())
    }
}

fn map_of(device: &Arc<Device>, landings: &[Landing], scene_radius: f64) -> Result<Buffer> {
    let texels = photon_map(landings, scene_radius);
    upload(device, "photon map", &texels, Some(vk::Format::R32G32B32A32_UINT))
}
