#include "rays.h"

#include <embree4/rtcore.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#if RTC_VERSION_MAJOR < 4
#error "Embree 4 or later is needed"
#endif

_Static_assert(sizeof(float) == 4 && sizeof(unsigned) == sizeof(uint32_t), "Embree's fields are 32 bits wide");

/* Geometry ids: a scene has at most these two. */
enum { TRIANGLES = 0, QUADS = 1 };

struct radiosity_scene {
  RTCScene scene;
  uint32_t packet_width;
  uint32_t n_triangles;
  uint32_t *codes; /* 2 face for each triangle, then for each quad; never empty */
};

/* ---- errors ------------------------------------------------------------------------------------ */

/* Embree reports an error on the thread whose call failed, before that call returns. The first one of a call
 * is kept: later ones follow from it. */
static _Thread_local radiosity_error last_error;

static void on_error(void *user, enum RTCError code, const char *message) {
  (void)user;
  if (last_error.code != RTC_ERROR_NONE) return;
  last_error.code = (int)code;
  if (message) strncpy((char *)last_error.message, message, sizeof last_error.message - 1);
}

static void clear_error(void) { memset(&last_error, 0, sizeof last_error); }

static RTCDevice embree(radiosity_device *device) { return (RTCDevice)device; }

/* ---- device ------------------------------------------------------------------------------------ */

uint32_t radiosity_version_of_headers(void) { return RTC_VERSION; }

radiosity_device *radiosity_device_new(const char *config, radiosity_error *error) {
  clear_error();
  RTCDevice device = rtcNewDevice(config);
  if (device) {
    rtcSetDeviceErrorFunction(device, on_error, NULL);
  } else {
    on_error(NULL, rtcGetDeviceError(NULL), "the device could not be created");
    if (last_error.code == RTC_ERROR_NONE) last_error.code = RTC_ERROR_UNKNOWN;
  }
  *error = last_error;
  return (radiosity_device *)device;
}

void radiosity_device_free(radiosity_device *device) { rtcReleaseDevice(embree(device)); }

uint32_t radiosity_device_version(radiosity_device *device) {
  return (uint32_t)rtcGetDeviceProperty(embree(device), RTC_DEVICE_PROPERTY_VERSION);
}

uint32_t radiosity_device_packet_width(radiosity_device *device) {
  if (rtcGetDeviceProperty(embree(device), RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
  if (rtcGetDeviceProperty(embree(device), RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) return 8;
  if (rtcGetDeviceProperty(embree(device), RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED)) return 4;
  return 1;
}

/* ---- scene ------------------------------------------------------------------------------------- */

/* Adds triangles (3 corners) or quads (4 corners). Failures are left to the caller to see in last_error. */
static void add_faces(RTCDevice device, RTCScene scene, RTCBuffer vertices, size_t n_vertices, const uint32_t *corners,
                      size_t n, unsigned id) {
  if (n == 0 || last_error.code != RTC_ERROR_NONE) return;
  const size_t n_corners = id == TRIANGLES ? 3 : 4;
  const enum RTCFormat format = id == TRIANGLES ? RTC_FORMAT_UINT3 : RTC_FORMAT_UINT4;
  RTCGeometry geometry =
      rtcNewGeometry(device, id == TRIANGLES ? RTC_GEOMETRY_TYPE_TRIANGLE : RTC_GEOMETRY_TYPE_QUAD);
  if (!geometry) return;
  rtcSetGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, 3 * sizeof(float),
                       n_vertices);
  void *copy = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, format, n_corners * sizeof *corners, n);
  if (copy && last_error.code == RTC_ERROR_NONE) {
    memcpy(copy, corners, n * n_corners * sizeof *corners);
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
  }
  rtcReleaseGeometry(geometry);
}

/* Returns a committed scene; on failure NULL or a scene of no use, and last_error is set. */
static RTCScene build(RTCDevice device, const radiosity_mesh *mesh) {
  RTCScene scene = rtcNewScene(device);
  if (!scene) return NULL;
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  if (mesh->n_triangles + mesh->n_quads > 0) {
    /* Both kinds of faces share the vertices. Embree reads 16 bytes at each: the last one needs room. */
    const size_t size = mesh->n_vertices * 3 * sizeof(float);
    RTCBuffer vertices = rtcNewBuffer(device, size + 16);
    void *copy = vertices ? rtcGetBufferData(vertices) : NULL;
    if (copy) {
      memcpy(copy, mesh->vertices, size);
      memset((char *)copy + size, 0, 16);
      add_faces(device, scene, vertices, mesh->n_vertices, mesh->triangles, mesh->n_triangles, TRIANGLES);
      add_faces(device, scene, vertices, mesh->n_vertices, mesh->quads, mesh->n_quads, QUADS);
    }
    if (vertices) rtcReleaseBuffer(vertices);
  }
  if (last_error.code == RTC_ERROR_NONE) rtcCommitScene(scene);
  return scene;
}

radiosity_scene *radiosity_scene_new(radiosity_device *device, const radiosity_mesh *mesh, uint32_t packet_width,
                                     radiosity_error *error) {
  clear_error();
  const size_t n = mesh->n_triangles + mesh->n_quads;
  radiosity_scene *scene = calloc(1, sizeof *scene);
  uint32_t *codes = malloc((n + 1) * sizeof *codes); /* a miss reads the first entry */
  if (scene && codes) {
    for (size_t i = 0; i < n; i++) codes[i] = 2 * mesh->faces[i];
    codes[n] = 0;
    scene->codes = codes;
    scene->n_triangles = (uint32_t)mesh->n_triangles;
    scene->packet_width = packet_width;
    scene->scene = build(embree(device), mesh);
    if (!scene->scene && last_error.code == RTC_ERROR_NONE) on_error(NULL, RTC_ERROR_UNKNOWN, "no scene was made");
  } else {
    free(codes);
    on_error(NULL, RTC_ERROR_OUT_OF_MEMORY, "no memory for the table of faces");
  }
  *error = last_error;
  if (error->code == RTC_ERROR_NONE) return scene;
  if (scene) radiosity_scene_free(scene);
  return NULL;
}

void radiosity_scene_free(radiosity_scene *scene) {
  if (scene->scene) rtcReleaseScene(scene->scene);
  free(scene->codes);
  free(scene);
}

/* ---- queries ----------------------------------------------------------------------------------- */

/* As many bytes as the largest field of a packet, twice: room for two fields that the headers do not know. */
enum { CANARY = 128, CANARY_BYTE = 0xa5 };

static size_t changed(const unsigned char canary[CANARY]) {
  size_t n = 0;
  for (int i = 0; i < CANARY; i++) n += canary[i] != CANARY_BYTE;
  return n;
}

#define WIDTH 16
#include "packet.h"
#define WIDTH 8
#include "packet.h"
#define WIDTH 4
#include "packet.h"

/* A device without packets traces ray by ray. The structs of single rays have no arrays, hence no template. */

static bool load_ray(const radiosity_rays *rays, size_t k, struct RTCRay *ray) {
  memset(ray, 0, sizeof *ray);
  ray->org_x = rays->origin[0][k];
  ray->org_y = rays->origin[1][k];
  ray->org_z = rays->origin[2][k];
  ray->dir_x = rays->direction[0][k];
  ray->dir_y = rays->direction[1][k];
  ray->dir_z = rays->direction[2][k];
  ray->tfar = rays->t_far[k];
  ray->mask = ~0u;
  return isfinite(ray->org_x) && isfinite(ray->org_y) && isfinite(ray->org_z) && isfinite(ray->dir_x) &&
         isfinite(ray->dir_y) && isfinite(ray->dir_z);
}

static void closest_hits_1(const radiosity_scene *scene, const radiosity_rays *rays,
                           struct RTCIntersectArguments *arguments, const radiosity_hits *hits) {
  for (size_t k = 0; k < rays->n; k++) {
    struct RTCRayHit query;
    memset(&query.hit, 0xff, sizeof query.hit);
    query.hit.u = query.hit.v = 0;
    if (load_ray(rays, k, &query.ray)) rtcIntersect1(scene->scene, &query, arguments);
    const float along =
        query.hit.Ng_x * query.ray.dir_x + query.hit.Ng_y * query.ray.dir_y + query.hit.Ng_z * query.ray.dir_z;
    uint32_t code = RADIOSITY_MISS;
    if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID)
      code = scene->codes[query.hit.primID + (query.hit.geomID == QUADS ? scene->n_triangles : 0)] | (along > 0);
    hits->face_and_side[k] = code;
    hits->t[k] = query.ray.tfar;
    hits->u[k] = query.hit.u;
    hits->v[k] = query.hit.v;
  }
}

static void occluded_1(const radiosity_scene *scene, const radiosity_rays *rays, struct RTCOccludedArguments *arguments,
                       bool *blocked) {
  for (size_t k = 0; k < rays->n; k++) {
    struct RTCRay ray;
    const bool valid = load_ray(rays, k, &ray);
    if (valid) rtcOccluded1(scene->scene, &ray, arguments);
    blocked[k] = valid && ray.tfar == -INFINITY;
  }
}

static size_t stray_bytes_1(RTCScene scene, const float origin[3], const float direction[3], bool *hit) {
  struct {
    struct RTCRayHit query;
    unsigned char canary[CANARY];
  } guarded;
  memset(&guarded, CANARY_BYTE, sizeof guarded);
  const float t_far = INFINITY;
  const radiosity_rays ray = {
      {origin, origin + 1, origin + 2}, {direction, direction + 1, direction + 2}, &t_far, 1};
  load_ray(&ray, 0, &guarded.query.ray);
  guarded.query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene, &guarded.query, NULL);
  *hit = *hit && guarded.query.hit.geomID == TRIANGLES;
  return changed(guarded.canary);
}

size_t radiosity_device_stray_bytes(radiosity_device *device, radiosity_error *error) {
  static const float vertices[9] = {-1, -1, 1, 2, -1, 1, -1, 2, 1};
  static const uint32_t corners[3] = {0, 1, 2};
  static const float origin[3] = {0, 0, 0}, direction[3] = {0, 0, 1};
  const radiosity_mesh mesh = {.vertices = vertices, .n_vertices = 3, .triangles = corners, .n_triangles = 1};
  size_t stray = 0;
  bool hit = true;
  clear_error();
  RTCScene scene = build(embree(device), &mesh);
  if (last_error.code == RTC_ERROR_NONE) {
    stray = stray_bytes_1(scene, origin, direction, &hit);
    switch (radiosity_device_packet_width(device)) {
      case 16: stray += stray_bytes_16(scene, origin, direction, &hit); break;
      case 8: stray += stray_bytes_8(scene, origin, direction, &hit); break;
      case 4: stray += stray_bytes_4(scene, origin, direction, &hit); break;
    }
    if (!hit) on_error(NULL, RTC_ERROR_UNKNOWN, "a trial ray missed the triangle in front of it");
  }
  if (scene) rtcReleaseScene(scene);
  *error = last_error;
  return stray;
}

void radiosity_closest_hits(const radiosity_scene *scene, const radiosity_rays *rays, bool coherent,
                            const radiosity_hits *hits) {
  struct RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  switch (scene->packet_width) {
    case 16: closest_hits_16(scene, rays, &arguments, hits); break;
    case 8: closest_hits_8(scene, rays, &arguments, hits); break;
    case 4: closest_hits_4(scene, rays, &arguments, hits); break;
    default: closest_hits_1(scene, rays, &arguments, hits);
  }
}

void radiosity_occluded(const radiosity_scene *scene, const radiosity_rays *rays, bool coherent, bool *blocked) {
  struct RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  switch (scene->packet_width) {
    case 16: occluded_16(scene, rays, &arguments, blocked); break;
    case 8: occluded_8(scene, rays, &arguments, blocked); break;
    case 4: occluded_4(scene, rays, &arguments, blocked); break;
    default: occluded_1(scene, rays, &arguments, blocked);
  }
}

void radiosity_return_freed_blocks(int block_bytes, int kept_bytes) {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, block_bytes);
  mallopt(M_TRIM_THRESHOLD, kept_bytes);
#else
  (void)block_bytes;
  (void)kept_bytes;
#endif
}
