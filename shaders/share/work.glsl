// What the passes that send rays count. Sums are pairs: low, high.
#ifndef SHARE_WORK_GLSL
#define SHARE_WORK_GLSL
struct WorkCounts {
    uint reflection[2];
    uint refraction[2];
    uint shadow[2];
    uint node_visits[2];
    uint triangle_tests[2];
    uint unmatched_exits[2]; // left without having been entered
    uint lights_cut_off[2];   // surfaces at which the loop over lights was left before its end
    uint lost[2];             // throughput that was not followed, in steps of 2^-16, summed over pixels
    uint most_lost;           // the largest of a pixel, as the bits of a float
    uint indirect[2];         // rays of paths
    uint not_finite;          // estimates of paths that were no numbers, and left out
    uint not_finite_event;    // where the first of them was met: the surface of its path, counted from 1
    uint not_finite_pixel;    // x | y << 16
    uint not_finite_material;
};
#endif
