// Sizes of indirect dispatches, which the device itself computes.
// Where to read: Vulkan specification, VkDispatchIndirectCommand.
#ifndef SHARE_TILES_GLSL
#define SHARE_TILES_GLSL

// A VkDispatchIndirectCommand, and the number of listed tiles: the last row of workgroups may exceed it. Every Vulkan
// device dispatches at least 65535 workgroups along x; longer lists continue along y.
struct WorkSize {
    uint x;
    uint y;
    uint z;
    uint count;
};

// Sizes of the dispatches over a queue of paths.
struct QueueSize {
    WorkSize paths;  // two paths per invocation; `count` is the number of entries
    WorkSize chunks; // one invocation per chunk of entries
};

// Sizes of the dispatches of one step of reflection and refraction, one ray tree per invocation.
struct StepSizes {
    WorkSize beginning; // complete trees, which take the next pixels
    WorkSize growing;   // trees that follow a branch
    WorkSize met;       // trees whose branch has met a surface
};
#endif
