// Work counters of the passes with rays. Sums are pairs of words: low, high.
#ifndef SHARE_WORK_GLSL
#define SHARE_WORK_GLSL
struct WorkCounts {
    uint reflection[2];
    uint refraction[2];
    uint shadow[2];
    uint node_visits[2];
    uint triangle_tests[2];
    uint unmatched_exits[2]; // exits from media without an entry
    uint lights_cut_off[2];   // surfaces whose loop over lights ended early
    uint lost[2];             // throughput of branches and paths cut off, in steps of 2^-16, summed over pixels
    uint most_lost;           // the largest loss of one pixel, as the bits of a float
    uint indirect[2];         // rays of paths, without shadow rays
    uint not_finite;          // path contributions that were NaN or infinite, and were dropped
    uint not_finite_event;    // vertex of the first of those, counted from 1 along its path
    uint not_finite_pixel;    // pixel of the first of those, x | y << 16
    uint not_finite_material;
};
#endif
