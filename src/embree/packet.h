/* Queries in packets of WIDTH rays; rays.c includes this file once for each width.
 *
 * Whole fields are copied at a time: twelve scalar stores per ray cost 15 to 20 % of the rate. What no query
 * changes is written once per batch. */

#define GLUE2(a, b) a##b
#define GLUE(a, b) GLUE2(a, b)
#define RAY GLUE(RTCRay, WIDTH)
#define RAY_HIT GLUE(RTCRayHit, WIDTH)

/* Writes what is the same for all rays, and zeros where the last packet has no rays. */
static void GLUE(init_rays_, WIDTH)(struct RAY *ray) {
  memset(ray, 0, sizeof *ray); /* tnear, time, id, flags */
  for (int i = 0; i < WIDTH; i++) ray->mask[i] = ~0u;
}

/* Copies at most WIDTH rays from the k-th on, and marks those that exist and are finite as valid. */
static inline void GLUE(load_rays_, WIDTH)(const radiosity_rays *rays, size_t k, struct RAY *ray, int *valid) {
  _Static_assert(sizeof ray->org_x == WIDTH * sizeof(float), "a field holds one float for each ray");
  const size_t left = rays->n - k;
  if (left >= WIDTH) {
    memcpy(ray->org_x, rays->origin[0] + k, sizeof ray->org_x);
    memcpy(ray->org_y, rays->origin[1] + k, sizeof ray->org_y);
    memcpy(ray->org_z, rays->origin[2] + k, sizeof ray->org_z);
    memcpy(ray->dir_x, rays->direction[0] + k, sizeof ray->dir_x);
    memcpy(ray->dir_y, rays->direction[1] + k, sizeof ray->dir_y);
    memcpy(ray->dir_z, rays->direction[2] + k, sizeof ray->dir_z);
    memcpy(ray->tfar, rays->t_far + k, sizeof ray->tfar);
  } else {
    const size_t size = left * sizeof(float);
    memcpy(ray->org_x, rays->origin[0] + k, size);
    memcpy(ray->org_y, rays->origin[1] + k, size);
    memcpy(ray->org_z, rays->origin[2] + k, size);
    memcpy(ray->dir_x, rays->direction[0] + k, size);
    memcpy(ray->dir_y, rays->direction[1] + k, size);
    memcpy(ray->dir_z, rays->direction[2] + k, size);
    memcpy(ray->tfar, rays->t_far + k, size);
  }
  for (int i = 0; i < WIDTH; i++) {
    /* 0 x is 0 if x is finite, and NaN otherwise. */
    const float zero = 0 * ray->org_x[i] + 0 * ray->org_y[i] + 0 * ray->org_z[i] + 0 * ray->dir_x[i] +
                       0 * ray->dir_y[i] + 0 * ray->dir_z[i];
    valid[i] = zero == 0 ? -1 : 0;
  }
  for (size_t i = left; i < WIDTH; i++) valid[i] = 0;
}

static void GLUE(closest_hits_, WIDTH)(const radiosity_scene *scene, const radiosity_rays *rays,
                                       struct RTCIntersectArguments *arguments, const radiosity_hits *hits) {
  _Alignas(64) int valid[WIDTH];
  _Alignas(64) uint32_t code[WIDTH];
  struct RAY_HIT packet;
  memset(&packet.hit, 0xff, sizeof packet.hit); /* instance ids: none */
  GLUE(init_rays_, WIDTH)(&packet.ray);
  for (size_t k = 0; k < rays->n; k += WIDTH) {
    GLUE(load_rays_, WIDTH)(rays, k, &packet.ray, valid);
    /* After a miss u and v must not be what an earlier packet left there. */
    memset(packet.hit.u, 0, sizeof packet.hit.u);
    memset(packet.hit.v, 0, sizeof packet.hit.v);
    memset(packet.hit.geomID, 0xff, sizeof packet.hit.geomID); /* RTC_INVALID_GEOMETRY_ID */
    GLUE(rtcIntersect, WIDTH)(valid, scene->scene, &packet, arguments);

    for (int i = 0; i < WIDTH; i++) {
      const float along = packet.hit.Ng_x[i] * packet.ray.dir_x[i] + packet.hit.Ng_y[i] * packet.ray.dir_y[i] +
                          packet.hit.Ng_z[i] * packet.ray.dir_z[i];
      const uint32_t miss = packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? ~0u : 0;
      const uint32_t first = packet.hit.geomID[i] == QUADS ? scene->n_triangles : 0;
      const uint32_t primitive = (packet.hit.primID[i] + first) & ~miss;
      code[i] = scene->codes[primitive] | (along > 0 ? 1u : 0u) | miss;
    }
    if (rays->n - k >= WIDTH) {
      memcpy(hits->face_and_side + k, code, sizeof code);
      memcpy(hits->t + k, packet.ray.tfar, sizeof packet.ray.tfar);
      memcpy(hits->u + k, packet.hit.u, sizeof packet.hit.u);
      memcpy(hits->v + k, packet.hit.v, sizeof packet.hit.v);
    } else {
      const size_t size = (rays->n - k) * sizeof(float);
      memcpy(hits->face_and_side + k, code, size);
      memcpy(hits->t + k, packet.ray.tfar, size);
      memcpy(hits->u + k, packet.hit.u, size);
      memcpy(hits->v + k, packet.hit.v, size);
    }
  }
}

static void GLUE(occluded_, WIDTH)(const radiosity_scene *scene, const radiosity_rays *rays,
                                   struct RTCOccludedArguments *arguments, bool *blocked) {
  _Alignas(64) int valid[WIDTH];
  struct RAY packet;
  GLUE(init_rays_, WIDTH)(&packet);
  for (size_t k = 0; k < rays->n; k += WIDTH) {
    GLUE(load_rays_, WIDTH)(rays, k, &packet, valid);
    GLUE(rtcOccluded, WIDTH)(valid, scene->scene, &packet, arguments);
    const size_t n = rays->n - k < WIDTH ? rays->n - k : WIDTH;
    for (size_t i = 0; i < n; i++) blocked[k + i] = valid[i] != 0 && packet.tfar[i] == -INFINITY;
  }
}

/* See radiosity_device_stray_bytes. */
static size_t GLUE(stray_bytes_, WIDTH)(RTCScene scene, const float origin[3], const float direction[3], bool *hit) {
  struct {
    struct RAY_HIT packet;
    unsigned char canary[CANARY];
  } guarded;
  _Alignas(64) int valid[WIDTH];
  memset(&guarded, CANARY_BYTE, sizeof guarded);
  GLUE(init_rays_, WIDTH)(&guarded.packet.ray);
  for (int i = 0; i < WIDTH; i++) {
    guarded.packet.ray.org_x[i] = origin[0];
    guarded.packet.ray.org_y[i] = origin[1];
    guarded.packet.ray.org_z[i] = origin[2];
    guarded.packet.ray.dir_x[i] = direction[0];
    guarded.packet.ray.dir_y[i] = direction[1];
    guarded.packet.ray.dir_z[i] = direction[2];
    guarded.packet.ray.tfar[i] = INFINITY;
    guarded.packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    valid[i] = -1;
  }
  GLUE(rtcIntersect, WIDTH)(valid, scene, &guarded.packet, NULL);
  for (int i = 0; i < WIDTH; i++) *hit = *hit && guarded.packet.hit.geomID[i] == TRIANGLES;
  return changed(guarded.canary);
}

#undef GLUE2
#undef GLUE
#undef RAY
#undef RAY_HIT
#undef WIDTH
