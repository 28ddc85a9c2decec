// Sizes of dispatches that the device itself decides.
#ifndef SHARE_TILES_GLSL
#define SHARE_TILES_GLSL

// A VkDispatchIndirectCommand, and the number of tiles listed: the last row of workgroups may run past it. Every Vulkan
// device dispatches 65535 workgroups along x; longer lists go on along y.
struct WorkSize {
    uint x;
    uint y;
    uint z;
    uint count;
};

// Sizes of the dispatches over a queue.
struct QueueSize {
    WorkSize paths;  // two paths in each invocation; `count` is that of entries
    WorkSize chunks; // an invocation for each chunk of entries
};
#endif
