! The gear mesh for AUTO-07p: mesh force and mesh stiffness smoothed over a width.
!
!   x'' + 2 beta / nu x' + c(tau) g(x) / nu^2 = 1 / nu^2
!
! g: both flanks as hyperbolas of width w; c: the rectangle as a tanh of width w in cos tau.
! cos tau and sin tau are the limit cycle of an oscillator, so that the system is autonomous.
!
! PAR: 1 nu, 2 beta, 3 kappa, 4 epsilon, 5 backlash, 6 w, 11 period

      SUBROUTINE FUNC(NDIM, U, ICP, PAR, IJAC, F, DFDU, DFDP)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC
      DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)
      DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)
      DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM, NDIM), DFDP(NDIM, *)
      DOUBLE PRECISION :: nu, w, pi, high, c, g, far, radius

      pi = 4.0D0 * ATAN(1.0D0)
      nu = PAR(1)
      w = PAR(6)
      high = 1.0D0 / (PAR(3) + (1.0D0 - PAR(3)) * (PAR(4) - 1.0D0))
      c = 0.5D0 * (1.0D0 + TANH((U(3) - COS(pi * (PAR(4) - 1.0D0))) / w))
      c = high * (PAR(3) + (1.0D0 - PAR(3)) * c)
      far = -(U(1) + PAR(5))
      g = 0.5D0 * (U(1) + SQRT(U(1)**2 + w**2)) - 0.5D0 * (far + SQRT(far**2 + w**2))
      radius = U(3)**2 + U(4)**2
      F(1) = U(2)
      F(2) = (1.0D0 - c * g) / nu**2 - 2.0D0 * PAR(2) / nu * U(2)
      F(3) = U(3) * (1.0D0 - radius) - U(4)
      F(4) = U(4) * (1.0D0 - radius) + U(3)
      END SUBROUTINE FUNC

      SUBROUTINE STPNT(NDIM, U, PAR, T)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM
      DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM), PAR(*)
      DOUBLE PRECISION, INTENT(IN) :: T
      END SUBROUTINE STPNT

      SUBROUTINE BCND
      END SUBROUTINE BCND

      SUBROUTINE ICND
      END SUBROUTINE ICND

      SUBROUTINE FOPT
      END SUBROUTINE FOPT

      SUBROUTINE PVLS
      END SUBROUTINE PVLS
