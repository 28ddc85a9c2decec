// The photon map: density estimation of the light that smooth surfaces send on from punctual lights (caustics).
// Photons leave the punctual lights, follow smooth surfaces (pass/trace_photons.comp), and land on surfaces that scatter.
// Each landed photon is spread over a disk as wide as the distance to its nearest neighbours (src/transport/photon_map.rs).
// A path vertex looks up the photons whose disks cover it, in a bounding volume hierarchy.
// Where to read: Jensen 1996 and 2001 (photon maps); Silverman 1986, chapter 5 (kernels of variable width);
// docs/decisions/paths.md. Assumes: bvh space, metres.
#ifndef PHOTON_MAP_GLSL
#define PHOTON_MAP_GLSL
#include "lib/encode.glsl"
#include "lib/loops.glsl"
#include "share/photon_map.glsl"

layout(constant) const bool PHOTON_MAP = false;
layout(paths, rgba32ui) readonly uniform uimageBuffer photon_map; // nodes, then photons
// @texels PhotonNode photon_node_at(photon_map)
// @texels Photon photon_at(photon_map)

// Light from one photon, which stands for all whose disks cover the vertex.
struct PhotonSample {
    uint to_light; // direction, as the photon has it
    vec3 arriving; // irradiance perpendicular to it, over the probability of the photon
};

// Irradiance that a photon brings to a point p with normal n: Epanechnikov kernel over the distance in the photon's plane.
vec3 irradiance_of(Photon photon, vec3 p, vec3 n) {
    vec3 normal = unit_from_octahedral(unpackSnorm4x8(photon.normal_radius).xy);
    float radius = uintBitsToFloat(photon.normal_radius & 0xffff0000u);
    vec3 off = p - photon.position;
    float height = dot(off, normal);
    float across2 = dot(off, off) - height * height;
    float share = 1.0 - across2 / (radius * radius);
    bool covers = share > 0.0 && abs(height) <= DISK_THICKNESS * radius && abs(dot(n, normal)) >= SAME_SURFACE;
    return covers ? photon.irradiance * share : vec3(0.0);
}

vec3 to_light_of(PhotonSample photon) {
    return unit_from_octahedral(unpackSnorm2x16(photon.to_light));
}

// Draws one of the photons that cover a point, in proportion to what it brings (weighted reservoir sampling, Chao 1982).
// `x` is a uniform random number. None where it is not `wanted`.
PhotonSample sample_photons(vec3 p, vec3 n, float x, bool wanted) {
    uint chosen = 0;
    vec3 brought = vec3(0.0);
    float chosen_weight = 1.0;
    float sum = 0.0;
    uint end = wanted ? photon_node_at(0).next : 0u;
    uint at = 0;
    // No last iteration assigns what is used after its loop: lavapipe may lose it (lib/trace.glsl).
    uint count;
    do {
        // Goes to the next leaf whose box holds the point. So the lanes of a subgroup visit photons together (Aila and Laine
        // 2009; docs/decisions/architectures.md).
        count = 0;
        uint first = 0;
        bool searches;
        do {
            searches = count == 0 && at < end && loop_iterations < LOOP_BUDGET;
            PhotonNode node = photon_node_at(searches ? at : 0u);
            bool inside = searches && all(greaterThanEqual(p, node.low)) && all(lessThanEqual(p, node.high));
            count = inside ? node.photons & ((1u << PHOTON_COUNT_BITS) - 1u) : count;
            first = inside ? node.photons >> PHOTON_COUNT_BITS : first;
            at = searches ? inside ? at + 1 : node.next : at;
        } while (searches);
        for (uint i = 0; i < count; i++) {
            Photon photon = photon_at(first + i);
            vec3 now = irradiance_of(photon, p, n);
            float weight = max(now.x, max(now.y, now.z));
            sum += weight;
            // The photon replaces the chosen one with probability weight / sum; x is rescaled to the rest of its range.
            float keep = sum > 0.0 ? 1.0 - weight / sum : 1.0;
            bool taken = weight > 0.0 && x >= keep;
            x = taken ? (x - keep) / (1.0 - keep) : x / max(keep, 1e-30);
            chosen = taken ? photon.to_light : chosen;
            brought = taken ? now : brought;
            chosen_weight = taken ? weight : chosen_weight;
        }
    } while (count > 0);
    return PhotonSample(chosen, brought * (sum / chosen_weight));
}
#endif
