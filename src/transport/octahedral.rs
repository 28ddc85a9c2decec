//! Octahedral encoding of unit vectors, as shaders/lib/encode.glsl decodes it.
//!
//! Read Cigolle et al., JCGT 3(2) 2014, "A Survey of Efficient Representations for Independent Unit Vectors".

use glam::{DVec2, DVec3};

/// A unit vector as a point of [−1, 1]² (`octahedral_from_unit`).
pub(super) fn octahedral_from_unit(n: DVec3) -> DVec2 {
    let p = n.truncate() / (n.x.abs() + n.y.abs() + n.z.abs());
    let sign = |x: f64| if x >= 0.0 { 1.0 } else { -1.0 };
    if n.z < 0.0 { DVec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y)) } else { p }
}

/// The unit vector of a point of [−1, 1]² (`unit_from_octahedral`).
pub(super) fn unit_from_octahedral(p: DVec2) -> DVec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = (-z).max(0.0);
    let towards = |x: f64| x + if x >= 0.0 { -fold } else { fold };
    DVec3::new(towards(p.x), towards(p.y), z).normalize()
}

/// Two signed normalised numbers of 16 bits in a word, for `unpackSnorm2x16`.
pub(super) fn pack_snorm_2x16(p: DVec2) -> u32 {
    let [x, y] = p.to_array().map(|x| u32::from((x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16));
    x | y << 16
}

/// The inverse of [`pack_snorm_2x16`].
pub(super) fn unpack_snorm_2x16(word: u32) -> DVec2 {
    DVec2::from([word, word >> 16].map(|half| f64::from(half as u16 as i16).max(-32767.0) / 32767.0))
}

/// Two signed normalised numbers of 8 bits in the lower half of a word, for `unpackSnorm4x8`.
pub(super) fn pack_snorm_2x8(p: DVec2) -> u32 {
    let [x, y] = p.to_array().map(|x| u32::from((x.clamp(-1.0, 1.0) * 127.0).round() as i8 as u8));
    x | y << 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_vectors_come_back() {
        for (x, y, z) in [(1.0, 2.0, 3.0), (-1.0, 0.5, -2.0), (0.0, 0.0, -1.0), (0.3, -4.0, 0.1), (-5.0, -1.0, -1e-9)] {
            let n = DVec3::new(x, y, z).normalize();
            assert!(unit_from_octahedral(octahedral_from_unit(n)).distance(n) < 1e-15, "{n}");
            // Half a step of each coordinate, which the folded map widens.
            assert!(
                unit_from_octahedral(unpack_snorm_2x16(pack_snorm_2x16(octahedral_from_unit(n)))).distance(n) < 7e-5
            );
        }
    }
}
