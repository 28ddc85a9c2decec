// The photon map: rays of photons and where they land, and the photons with the hierarchy over them.
// Where to read: docs/decisions/paths.md. Assumes: bvh space, metres.
#ifndef SHARE_PHOTON_MAP_GLSL
#define SHARE_PHOTON_MAP_GLSL
// A photon as it leaves its light.
struct PhotonRay {
    vec3 origin;
    uint light;     // index in the table of lights
    vec3 direction; // unit vector
    float measure;  // its share of the light's directions in sr; of a directional light, of its cross-section in m²
    uvec4 media;    // around the origin, as entries of lib/media.glsl
};

// Where a photon arrives after a surface has deflected it. `power` is 0 where it does not.
struct Landing {
    vec3 position;
    vec3 normal;   // of the triangle
    vec3 to_light; // unit vector to where it comes from
    vec3 power;    // in the unit of the light, times the square of the light's index of refraction over that of the landing
};

// A node of the bounding volume hierarchy over photons, in depth-first order.
struct PhotonNode {
    vec3 low;     // smallest corner of its box
    uint next;    // node after its subtree (skip pointer)
    vec3 high;    // largest corner
    uint photons; // of a leaf: place of the first << PHOTON_COUNT_BITS | their number; 0 of an inner node
};

// A photon of the map, behind the nodes: places count both, because both have two texels.
struct Photon {
    vec3 position;
    uint to_light;      // the direction that it comes from, octahedral in 2x16 bits
    vec3 irradiance;    // at the middle of its disk, the largest, on a plane perpendicular to its direction
    uint normal_radius; // the surface's normal, octahedral in 2x8 bits; upper half of a float: radius of the kernel in metres
};

const uint PHOTON_COUNT_BITS = 3;
// Smallest cosine between the normals of two points that lie on one surface. Neighbours of a photon lie on its side. A
// vertex may lie on either side, because the direction of the light tells which side it reaches.
const float SAME_SURFACE = 0.8;
// Largest distance of a point from a photon's plane, in radii of its disk.
const float DISK_THICKNESS = 0.25;
#endif
