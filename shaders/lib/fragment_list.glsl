// See-through fragments as lists per pixel: a G-buffer with as many layers as a pixel needs. Slots are handed out in
// whatever order fragments arrive; the reader sorts by depth, then by instance and triangle, so the picture does not
// depend on that order.
#ifndef FRAGMENT_LIST_GLSL
#define FRAGMENT_LIST_GLSL

const uint NODE_WORDS = 15;
const uint END_OF_LIST = 0xffffffffu;
// Layout of a node, in words:
//   0 next   1 depth (bits)   2 instance   3 triangle   4 material | roughness << 16
//   5 base.rg   6 base.b, metallic   7 normal, octahedral   8 emissive.rg   9 emissive.b, alpha   (halves, snorms)
//   10 occlusion (16 bits)   11 to 14 packed_layers (lib/texels.glsl)
#endif
