/* Made by cbindgen from src/lib.rs. */

#ifndef CASADOS_PENDULUM_H
#define CASADOS_PENDULUM_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

/**
 * Numbers of a state: position, angle, velocity, angular velocity.
 */
#define CASADOS_STATES 4

/**
 * Numbers of a control: the force.
 */
#define CASADOS_CONTROLS 1

/**
 * Bytes of memory that an integrator takes at most.
 */
#define CASADOS_SIZE 5120

/**
 * What the address of this memory is a multiple of.
 */
#define CASADOS_ALIGNMENT 8

/**
 * How a call ended.
 */
typedef enum {
  /**
   * All results are there and finite.
   */
  CasadosOk = 0,
  /**
   * A pointer that may not be null is.
   */
  CasadosNull = 1,
  /**
   * An address is not a multiple of what it has to be.
   */
  CasadosMisaligned = 2,
  /**
   * There is less memory than the integrator takes.
   */
  CasadosTooSmall = 3,
  /**
   * There is no integrator with such options.
   */
  CasadosInvalidOption = 4,
  /**
   * A state, a control or the length of the step is not finite.
   */
  CasadosNonFinite = 5,
  /**
   * The equations could not be solved, or results would not be finite.
   */
  CasadosFailed = 6,
} CasadosStatus;

/**
 * An integrator: two Gauss stages, and as many Newton iterations in every step as it was made
 * with.
 */
typedef struct CasadosPendulum CasadosPendulum;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Makes an integrator in `size` bytes of memory, which is to live as long as it, with so many
 * iterations, at least one. After an error `*integrator` is null.
 *
 * # Safety
 * `memory` is null, or points to `size` bytes that nothing else uses; `integrator` is null, or
 * points to a pointer.
 */
CasadosStatus casados_new(uint8_t *memory,
                          uintptr_t size,
                          uintptr_t iterations,
                          CasadosPendulum **integrator);

/**
 * One step of length `h`: from the state `x` and the control `u` to the state at its end, and its
 * derivatives, column after column. `dx_dx` and `dx_du` may be null: then they are not computed.
 * After an error nothing is written.
 *
 * # Safety
 * `integrator` is from `casados_new`, and in no other call; the others are null or point to as
 * many numbers as they have: `x` and `x_next` to `CASADOS_STATES`, `u` to `CASADOS_CONTROLS`, the
 * derivatives to their products.
 */
CasadosStatus casados_step(CasadosPendulum *integrator,
                           const double *x,
                           const double *u,
                           double h,
                           double *x_next,
                           double *dx_dx,
                           double *dx_du);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CASADOS_PENDULUM_H */
