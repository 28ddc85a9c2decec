// One level of the prefiltered environment (split sum): the map convolved with the GGX lobe of α = 16 / width of the level.
// N = V = R as in Karis 2013, where f cos / pdf of a sample is F G1(l). Filtered importance sampling: each sample reads the
// mip level that fits its density, and half a level more, because samples are not evenly spread.
// Sums are of differences from the texel in the middle of the lobe: a uniform map stays uniform to the last bit.
// Where to read: Karis 2013; Křivánek and Colbert, GPU Gems 3, chapter 20 (2007); RTR 4, section 10.5. Assumes: world axes,
// equirectangular maps.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 8, local_size_y = 8) in;
#include "lib/brdf.glsl"
#include "lib/encode.glsl"
#include "lib/frame.glsl"

layout(pass) uniform sampler2D environment_map;
layout(pass, scalar) writeonly buffer Level { vec4 level[]; };
layout(push_constant, scalar) uniform Push { uvec2 size; float alpha; float base_width; uint samples; };

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(at, size))) return;
    vec3 n = direction_from_equirectangular((vec2(at) + 0.5) / vec2(size));
    OrthonormalBasis frame = orthonormal_basis(n);
    vec3 middle = textureLod(environment_map, equirectangular_from_direction(n), 0.0).rgb;
    vec3 sum = vec3(0.0);
    float weight = 0.0;
    float across = 2.0 * PI / base_width; // a texel at the equator
    for (uint i = 0; i < samples; i++) {
        float x = (float(i) + 0.5) / float(samples);
        vec2 around = cos_sin_of_turns(float(bitfieldReverse(i)) * 2.3283064365386963e-10);
        GgxSample m = ggx_sample(x, alpha);
        vec3 h = (frame.t * around.x + frame.b * around.y) * m.sin_h + n * m.cos_h;
        vec3 l = 2.0 * dot(n, h) * h - n;
        float cos_l = dot(n, l);
        if (cos_l > 0.0) {
            // Each sample stands for a solid angle of 1 / (N pdf): read the mip level whose texels are that large.
            float pdf = ggx_distribution(n, h, alpha) * 0.25;
            float sin_pole = max(sqrt(max(1.0 - l.y * l.y, 0.0)), across);
            float lod = 0.5 - 0.5 * log2(float(samples) * pdf * across * across * sin_pole);
            float masking = smith_g2_over_g1(1.0, cos_l, alpha);
            vec3 seen = textureLod(environment_map, equirectangular_from_direction(l), max(lod, 0.0)).rgb;
            sum += (seen - middle) * masking;
            weight += masking;
        }
    }
    // The sum's rounding error is that of the middle texel: the result may be negative by as much.
    level[at.y * size.x + at.x] = vec4(max(middle + sum / max(weight, 1e-6), 0.0), 1.0);
}
