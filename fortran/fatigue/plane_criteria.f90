!> Fatigue parameters of one plane: Smith, Watson & Topper; Findley; Fatemi & Socie.
!>
!> On the plane of normal n a stress history is a normal stress sigma_n(t) and a shear traction of two components; tau_a is
!> the radius of the smallest circle around the path of the latter.
module hc_plane_criteria
  use hc_precision, only: wp
  use hc_smallest_ball, only: find_smallest_ball
  implicit none
  private

  public :: plane_criterion_t, smith_watson_topper_t, findley_t, fatemi_socie_t, stress_extent_t

  !> Bounds of the stresses of a history [Pa].
  type :: stress_extent_t
    !> Largest normal stress
    real(wp) :: normal = 0.0_wp
    !> Largest difference of principal stresses at a time, and of the change between two times
    real(wp) :: spread = 0.0_wp, change = 0.0_wp
    !> Range of the hydrostatic stress
    real(wp) :: hydrostatic = 0.0_wp
  end type stress_extent_t

  !> A parameter that is largest on the critical plane.
  type, abstract :: plane_criterion_t
  contains
    !> Value on a plane
    procedure(plane_value), deferred :: value
    !> Bound of the second derivative along a great circle, for a history
    procedure(bound_of), deferred :: curvature
    !> Lowest value that the parameter takes
    procedure, nopass :: least => unbounded
    !> Does the value depend on the shear traction?
    procedure, nopass :: uses_shear => always
  end type plane_criterion_t

  abstract interface
    !> Return the parameter of a plane; where it is certainly below `floor`, any number below that.
    pure real(wp) function plane_value(self, normal, shear, trace, floor)
      import :: plane_criterion_t, wp
      class(plane_criterion_t), intent(in) :: self
      !> Normal stress (times), shear traction (times, 2) and trace of the stress (times) [Pa]
      real(wp), intent(in), contiguous :: normal(:), shear(:, :), trace(:)
      !> Value of interest
      real(wp), intent(in) :: floor
    end function plane_value
    !> Return how fast the parameter can fall off around its largest value [its unit/rad^2].
    pure real(wp) function bound_of(self, extent)
      import :: plane_criterion_t, stress_extent_t, wp
      class(plane_criterion_t), intent(in) :: self
      !> Bounds of the stresses
      type(stress_extent_t), intent(in) :: extent
    end function bound_of
  end interface

  !> sigma_n,max times half the range of the normal strain [Pa] (K. N. Smith, P. Watson and T. H. Topper, J. Mater. 5 (1970)
  !> 767-778; on planes: D. F. Socie, J. Eng. Mater. Technol. 109 (1987) 293-298).
  type, extends(plane_criterion_t) :: smith_watson_topper_t
    !> Young's modulus [Pa] and Poisson's ratio
    real(wp) :: young_modulus = 1.0_wp, poisson_ratio = 0.0_wp
  contains
    procedure :: value => smith_watson_topper
    procedure :: curvature => curvature_of_smith_watson_topper
    procedure, nopass :: uses_shear => never
    procedure, nopass :: least => zero
  end type smith_watson_topper_t

  !> tau_a + slope sigma_n,max [Pa] (W. N. Findley, J. Eng. Ind. 81 (1959) 301-306).
  type, extends(plane_criterion_t) :: findley_t
    !> Influence of the normal stress
    real(wp) :: slope = 0.3_wp
  contains
    procedure :: value => findley
    procedure :: curvature => curvature_of_findley
  end type findley_t

  !> (tau_a/G) (1 + slope sigma_n,max/sigma_y), a strain (A. Fatemi and D. F. Socie, Fatigue Fract. Eng. Mater. Struct. 11
  !> (1988) 149-165).
  type, extends(plane_criterion_t) :: fatemi_socie_t
    !> Influence of the normal stress; shear modulus and yield stress [Pa]
    real(wp) :: slope = 1.0_wp, shear_modulus = 1.0_wp, yield_stress = 1.0_wp
  contains
    procedure :: value => fatemi_socie
    procedure :: curvature => curvature_of_fatemi_socie
  end type fatemi_socie_t

  !> Relative distance from the opposite point of a circle that makes no difference.
  real(wp), parameter :: opposite = 1.0e-10_wp

  !> Bounds of tau_a and of its derivatives along a great circle, over the change of the stress. With shares l_i of its points
  !> the square of the radius is the sum of l_i l_j |d_ij|^2/2, for three points at most |d|^2/3; for the difference d of the
  !> shear tractions at two times |d|, |d'| and |d''| are at most 1/2, sqrt(5)/2 and sqrt(26)/2.
  real(wp), parameter :: most_amplitude = 0.29_wp, most_slope = 0.65_wp, most_curvature = 1.48_wp

contains

  pure logical function always()
    always = .true.
  end function always

  pure logical function never()
    never = .false.
  end function never

  pure real(wp) function unbounded()
    unbounded = -huge(unbounded)
  end function unbounded

  pure real(wp) function zero()
    zero = 0.0_wp
  end function zero

  pure real(wp) function smith_watson_topper(self, normal, shear, trace, floor) result(value)
    class(smith_watson_topper_t), intent(in) :: self
    real(wp), intent(in), contiguous :: normal(:), shear(:, :), trace(:)
    real(wp), intent(in) :: floor
    real(wp) :: highest, most, least
    integer :: i

    associate (nu => self%poisson_ratio)
      highest = -huge(highest)
      most = -huge(most)
      least = huge(least)
      do i = 1, size(normal)
        highest = max(highest, normal(i))
        most = max(most, (1.0_wp + nu)*normal(i) - nu*trace(i))
        least = min(least, (1.0_wp + nu)*normal(i) - nu*trace(i))
      end do
    end associate
    value = highest*((most - least)/(2.0_wp*self%young_modulus))
  end function smith_watson_topper

  !> Bound of (a b)'' for a normal stress a, of |a'| <= spread, |a''| <= 2 spread, and a difference b of strains likewise.
  pure real(wp) function curvature_of_smith_watson_topper(self, extent) result(bound)
    class(smith_watson_topper_t), intent(in) :: self
    type(stress_extent_t), intent(in) :: extent
    real(wp) :: change, range

    change = (1.0_wp + self%poisson_ratio)*extent%change
    range = change/sqrt(3.0_wp) + (1.0_wp - 2.0_wp*self%poisson_ratio)*extent%hydrostatic
    bound = (extent%spread*(range + change) + max(extent%normal, 0.0_wp)*change)/self%young_modulus
  end function curvature_of_smith_watson_topper

  pure real(wp) function findley(self, normal, shear, trace, floor) result(value)
    class(findley_t), intent(in) :: self
    real(wp), intent(in), contiguous :: normal(:), shear(:, :), trace(:)
    real(wp), intent(in) :: floor

    value = self%slope*largest(normal)
    value = value + shear_amplitude(shear, floor - value)
  end function findley

  pure real(wp) function curvature_of_findley(self, extent) result(bound)
    class(findley_t), intent(in) :: self
    type(stress_extent_t), intent(in) :: extent
    bound = most_curvature*extent%change + 2.0_wp*abs(self%slope)*extent%spread
  end function curvature_of_findley

  pure real(wp) function fatemi_socie(self, normal, shear, trace, floor) result(value)
    class(fatemi_socie_t), intent(in) :: self
    real(wp), intent(in), contiguous :: normal(:), shear(:, :), trace(:)
    real(wp), intent(in) :: floor

    value = (1.0_wp + self%slope*max(largest(normal), 0.0_wp)/self%yield_stress)/self%shear_modulus
    value = value*shear_amplitude(shear, max(floor, 0.0_wp)/value) ! -huge(floor)/value would overflow
  end function fatemi_socie

  pure real(wp) function curvature_of_fatemi_socie(self, extent) result(bound)
    class(fatemi_socie_t), intent(in) :: self
    type(stress_extent_t), intent(in) :: extent
    real(wp) :: slope

    slope = abs(self%slope)/self%yield_stress
    bound = extent%change*(most_curvature*(1.0_wp + slope*max(extent%normal, 0.0_wp)) &
                           + 2.0_wp*(most_slope + most_amplitude)*slope*extent%spread)/self%shear_modulus
  end function curvature_of_fatemi_socie

  !> Compute the amplitude tau_a of a shear traction; where it is certainly below `floor`, a bound that is below it [Pa].
  pure real(wp) function shear_amplitude(shear, floor) result(amplitude)
    !> Shear traction (times, 2) [Pa]
    real(wp), intent(in), contiguous :: shear(:, :)
    !> Amplitude of interest [Pa]
    real(wp), intent(in) :: floor
    real(wp) :: center(2), middle(2), square, far(2)
    integer :: i, k

    ! the circle about the middle of the bounding box contains the path
    do k = 1, 2
      middle(k) = 0.5_wp*(largest(shear(:, k)) - largest(-shear(:, k)))
    end do
    square = 0.0_wp
    far = middle
    do i = 1, size(shear, 1)
      if ((shear(i, 1) - middle(1))**2 + (shear(i, 2) - middle(2))**2 <= square) cycle
      far = shear(i, :)
      square = (far(1) - middle(1))**2 + (far(2) - middle(2))**2
    end do
    amplitude = sqrt(square)
    if (amplitude < floor) return
    ! and is the smallest one if two points of the path lie opposite to each other on it, as turning points do
    square = 0.0_wp
    do i = 1, size(shear, 1)
      square = max(square, (shear(i, 1) - far(1))**2 + (shear(i, 2) - far(2))**2)
    end do
    if (0.5_wp*sqrt(square) < (1.0_wp - opposite)*amplitude) call find_smallest_ball(transpose(shear), center, amplitude)
  end function shear_amplitude

  !> Return the largest of some numbers, none of which is NaN: maxval, which looks for those, takes several times as long.
  pure real(wp) function largest(values)
    real(wp), intent(in), contiguous :: values(:)
    real(wp) :: lane(4)
    integer :: i, whole

    whole = 4*(size(values)/4)
    lane = -huge(lane)
    do i = 1, whole, 4
      lane = max(lane, values(i:i + 3))
    end do
    largest = max(max(lane(1), lane(2)), max(lane(3), lane(4)))
    do i = whole + 1, size(values)
      largest = max(largest, values(i))
    end do
  end function largest

end module hc_plane_criteria
