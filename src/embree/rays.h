/* The small C interface through which Rust uses Embree, and sets the allocator. Embree's own structs stay behind it, in rays.c,
 * which is compiled against the installed headers: a new field in one of them needs no change here. */
#ifndef RADIOSITY_RAYS_H
#define RADIOSITY_RAYS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The code of a ray that hits nothing. */
#define RADIOSITY_MISS 0xffffffffu

/* An Embree device. */
typedef struct radiosity_device radiosity_device;

/* A committed Embree scene and the table from its primitives to faces. */
typedef struct radiosity_scene radiosity_scene;

/* Why a call failed: an RTCError and Embree's own words, cut to the buffer. */
typedef struct {
  int code;
  uint8_t message[256]; /* ends with a zero */
} radiosity_error;

/* Faces: corners are indices into the vertices; every index must be in range. */
typedef struct {
  const float *vertices; /* [n_vertices][3] */
  size_t n_vertices;
  const uint32_t *triangles; /* [n_triangles][3] */
  size_t n_triangles;
  const uint32_t *quads; /* [n_quads][4] */
  size_t n_quads;
  const uint32_t *faces; /* [n_triangles + n_quads], below 2^31 - 1: the face of each triangle, then of each quad */
} radiosity_mesh;

/* n rays o + t d, 0 <= t <= t_far. */
typedef struct {
  const float *origin[3];
  const float *direction[3];
  const float *t_far;
  size_t n;
} radiosity_rays;

/* Where the answers for n rays go. */
typedef struct {
  uint32_t *face_and_side; /* 2 face + (1 if hit from behind), or RADIOSITY_MISS */
  float *t;
  float *u;
  float *v;
} radiosity_hits;

/* Version of the headers that rays.c was compiled with: major * 10000 + minor * 100 + patch. */
uint32_t radiosity_version_of_headers(void);

/* Creates a device, or returns NULL and sets the error. */
radiosity_device *radiosity_device_new(const char *config, radiosity_error *error);

void radiosity_device_free(radiosity_device *device);

/* Version of the library, in the form of radiosity_version_of_headers. */
uint32_t radiosity_device_version(radiosity_device *device);

/* The widest packet of rays that this device traces natively: 16, 8 or 4, or 1 where it has none. */
uint32_t radiosity_device_packet_width(radiosity_device *device);

/* Traces into packets that are followed by canaries, and returns how many bytes the library wrote behind the
 * end that the headers give to a packet: 0 unless headers and library disagree about a layout. Sets the error
 * if the trial scene cannot be built or the trial ray does not hit it. */
size_t radiosity_device_stray_bytes(radiosity_device *device, radiosity_error *error);

/* Builds a scene that is traced in packets of 16, 8 or 4 rays, or else ray by ray; or returns NULL and sets the
 * error. Everything is copied. */
radiosity_scene *radiosity_scene_new(radiosity_device *device, const radiosity_mesh *mesh, uint32_t packet_width,
                                     radiosity_error *error);

void radiosity_scene_free(radiosity_scene *scene);

/* Finds the first face along each ray; a ray that is not finite hits nothing. After a miss t is t_far, u and v are 0. */
void radiosity_closest_hits(const radiosity_scene *scene, const radiosity_rays *rays, bool coherent,
                            const radiosity_hits *hits);

/* Tells for each ray whether anything lies on it. */
void radiosity_occluded(const radiosity_scene *scene, const radiosity_rays *rays, bool coherent, bool *blocked);

/* Has freed blocks of block_bytes and more, and what is free at the end of a heap beyond kept_bytes, return to the system at once, where the C library is glibc. */
void radiosity_return_freed_blocks(int block_bytes, int kept_bytes);

#endif
