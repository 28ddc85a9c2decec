// See-through fragments as lists per pixel: a G-buffer with as many layers as a pixel needs. Slots are handed out in
// whatever order fragments arrive; the reader sorts by depth, then by instance and primitive, so the picture does not
// depend on that order.
#ifndef FRAGMENT_LIST_GLSL
#define FRAGMENT_LIST_GLSL

const uint NODE_WORDS = 13;
const uint END_OF_LIST = 0xffffffffu;
// Layout of a node, in words:
//   0 next   1 depth (bits)   2 instance   3 primitive   4 material | roughness << 16
//   5 base.rg   6 base.b, metallic   7 normal, octahedral   8 emissive.rg   9 emissive.b, alpha   (halves, snorms)
//   10 clearcoat, its roughness, specular, transmission (bytes)   11 occlusion, thickness (16 bits each)
//   12 normal of the clear coat, octahedral
#endif
