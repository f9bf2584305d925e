!> Life from the parameter of Smith, Watson & Topper:
!>
!>     sigma_n,max d_eps/2 = (sigma_f'^2/E) (2N)^(2b) + sigma_f' eps_f' (2N)^(b+c)
!>
!> (Basquin and Coffin-Manson with mean stress; N cycles to a crack.)
module hc_strain_life
  use hc_precision, only: wp
  use hc_error, only: error_t, raise, status
  implicit none
  private

  public :: strain_life_t, new_strain_life

  !> Constants of the curve of strain against life.
  type :: strain_life_t
    !> Young's modulus, strength sigma_f' [Pa]; exponents b and c below zero; ductility eps_f'
    real(wp) :: young_modulus = 0.0_wp, strength = 0.0_wp, b = 0.0_wp, ductility = 0.0_wp, c = 0.0_wp
  contains
    !> Parameter of Smith, Watson & Topper after a number of cycles
    procedure :: parameter_at
    !> Number of cycles for a value of the parameter
    procedure :: cycles
  end type strain_life_t

contains

  !> Set up a curve of strain against life.
  pure subroutine new_strain_life(curve, young_modulus, strength, b, ductility, c, error)
    !> The curve
    type(strain_life_t), intent(out) :: curve
    !> E and sigma_f' [Pa], b, eps_f', c
    real(wp), intent(in) :: young_modulus, strength, b, ductility, c
    !> Allocated if a constant makes no sense
    type(error_t), allocatable, intent(out) :: error

    if (.not. (young_modulus > 0.0_wp .and. strength > 0.0_wp .and. ductility >= 0.0_wp .and. b < 0.0_wp .and. c < 0.0_wp &
               .and. max(young_modulus, strength, ductility, -b, -c) < huge(b))) then
      call raise(error, status%invalid_input, 'expected positive moduli, and exponents b and c below 0')
      return
    end if
    curve = strain_life_t(young_modulus, strength, b, ductility, c)
  end subroutine new_strain_life

  !> Compute the parameter after N cycles [Pa].
  elemental real(wp) function parameter_at(self, n)
    class(strain_life_t), intent(in) :: self
    !> Cycles
    real(wp), intent(in) :: n
    parameter_at = self%strength**2/self%young_modulus*(2.0_wp*n)**(2.0_wp*self%b) &
                   + self%strength*self%ductility*(2.0_wp*n)**(self%b + self%c)
  end function parameter_at

  !> Find the cycles N for a parameter: halved in log N, from 1/2 (0 for more than that) to 1e30 (infinity for less); of NaN, NaN.
  elemental real(wp) function cycles(self, parameter)
    use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_positive_inf, ieee_is_nan
    class(strain_life_t), intent(in) :: self
    !> sigma_n,max d_eps/2 [Pa]
    real(wp), intent(in) :: parameter
    real(wp) :: low, high
    integer :: i

    low = log(0.5_wp)
    high = log(1.0e30_wp)
    if (ieee_is_nan(parameter)) then
      cycles = parameter
    else if (parameter > self%parameter_at(exp(low))) then
      cycles = 0.0_wp
    else if (parameter <= self%parameter_at(exp(high))) then
      cycles = ieee_value(0.0_wp, ieee_positive_inf)
    else
      do i = 1, 60 ! to the last bit
        if (self%parameter_at(exp(0.5_wp*(low + high))) > parameter) then
          low = 0.5_wp*(low + high)
        else
          high = 0.5_wp*(low + high)
        end if
      end do
      cycles = exp(0.5_wp*(low + high))
    end if
  end function cycles

end module hc_strain_life
