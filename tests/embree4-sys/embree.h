/* Embree's API, and what src/lib.rs must know of the layout of the two structs that it defines itself. */
#include <embree4/rtcore.h>

enum {
  HEADER_RAY_HIT_SIZE = sizeof(struct RTCRayHit),
  HEADER_RAY_HIT_ALIGN = _Alignof(struct RTCRayHit),
  HEADER_HIT_OFFSET = offsetof(struct RTCRayHit, hit),
  HEADER_NG_X_OFFSET = offsetof(struct RTCHit, Ng_x),
  HEADER_U_OFFSET = offsetof(struct RTCHit, u),
  HEADER_V_OFFSET = offsetof(struct RTCHit, v),
  HEADER_PRIM_ID_OFFSET = offsetof(struct RTCHit, primID),
  HEADER_GEOM_ID_OFFSET = offsetof(struct RTCHit, geomID),
  HEADER_INST_ID_OFFSET = offsetof(struct RTCHit, instID),
};
