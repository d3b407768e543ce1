/* What tracing costs at least: rays are copied from arrays into native packets, traced, and their hits counted, with
 * nothing around it. Builds its own scene, and shares no code with the library. */

#include <embree4/rtcore.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

/* Returns a scene of triangles, or NULL. */
RTCScene bare_scene_new(const float *vertices, size_t n_vertices, const uint32_t *triangles, size_t n_triangles) {
  RTCDevice device = rtcNewDevice("threads=1");
  if (!device) return NULL;
  RTCScene scene = rtcNewScene(device);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, n_vertices), vertices,
         12 * n_vertices);
  memcpy(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, n_triangles), triangles,
         12 * n_triangles);
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
  rtcCommitScene(scene);
  const bool failed = rtcGetDeviceError(device) != RTC_ERROR_NONE;
  rtcReleaseDevice(device);
  if (!failed) return scene;
  rtcReleaseScene(scene);
  return NULL;
}

void bare_scene_free(RTCScene scene) { rtcReleaseScene(scene); }

/* Defines the loop for packets of N rays; n is a multiple of N. */
#define DEFINE_TRACE(N)                                                                                              \
  static void trace_##N(RTCScene scene, const float *const origin[3], const float *const direction[3], size_t n,     \
                        struct RTCIntersectArguments *arguments, uint32_t *counts) {                                 \
    _Alignas(64) int valid[N];                                                                                       \
    struct RTCRayHit##N packet;                                                                                      \
    memset(valid, 0xff, sizeof valid);                                                                               \
    memset(&packet, 0, sizeof packet);                                                                               \
    memset(packet.ray.mask, 0xff, sizeof packet.ray.mask);                                                           \
    for (size_t k = 0; k < n; k += N) {                                                                              \
      memcpy(packet.ray.org_x, origin[0] + k, sizeof packet.ray.org_x);                                              \
      memcpy(packet.ray.org_y, origin[1] + k, sizeof packet.ray.org_y);                                              \
      memcpy(packet.ray.org_z, origin[2] + k, sizeof packet.ray.org_z);                                              \
      memcpy(packet.ray.dir_x, direction[0] + k, sizeof packet.ray.dir_x);                                           \
      memcpy(packet.ray.dir_y, direction[1] + k, sizeof packet.ray.dir_y);                                           \
      memcpy(packet.ray.dir_z, direction[2] + k, sizeof packet.ray.dir_z);                                           \
      for (int i = 0; i < N; i++) packet.ray.tfar[i] = INFINITY;                                                     \
      memset(packet.hit.geomID, 0xff, sizeof packet.hit.geomID);                                                     \
      rtcIntersect##N(valid, scene, &packet, arguments);                                                             \
      for (int i = 0; i < N; i++)                                                                                    \
        if (packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) counts[packet.hit.primID[i]]++;                         \
    }                                                                                                                \
  }

DEFINE_TRACE(4)
DEFINE_TRACE(8)
DEFINE_TRACE(16)

/* Traces n rays without an end, in packets as wide as is native, and adds 1 to the count of the triangle that each one
 * hits; n is a multiple of 16. */
void bare_trace(RTCScene scene, const float *const origin[3], const float *const direction[3], size_t n, bool coherent,
                uint32_t *counts) {
  struct RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  if (coherent) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  RTCDevice device = rtcGetSceneDevice(scene);
  if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED))
    trace_16(scene, origin, direction, n, &arguments, counts);
  else if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED))
    trace_8(scene, origin, direction, n, &arguments, counts);
  else
    trace_4(scene, origin, direction, n, &arguments, counts);
  rtcReleaseDevice(device);
}
