!> Similar bodies pressed by a constant load and sheared along one line: partial slip after reversals, too.
!>
!> C. Cattaneo, Rend. Accad. Naz. Lincei 27 (1938); R. D. Mindlin, J. Appl. Mech. 16 (1949) 259-268;
!> R. D. Mindlin and H. Deresiewicz, J. Appl. Mech. 20 (1953) 327-344.
!> A load beyond the sliding load has no solution: the results are not numbers.
!>
!> Equations: docs/theory/closed_solutions.md.
module hc_partial_slip
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  implicit none
  private

  public :: mindlin_t, plane_cattaneo_t, turning_points

  !> Spheres.
  type :: mindlin_t
    !> Coefficient of friction mu, above 0
    real(wp) :: friction_coefficient = 0.0_wp
    !> Normal load P [N]
    real(wp) :: normal_load = 0.0_wp
    !> Contact radius a [m]
    real(wp) :: contact_radius = 0.0_wp
    !> S = sum (2-nu_i)/G_i [1/Pa]
    real(wp) :: compliance = 0.0_wp
  contains
    procedure :: sliding_load, sliding_shift, stick_radius, shift, load, traction, &
                 shift_unloading, traction_unloading, energy_per_cycle
  end type mindlin_t

  !> Cylinders sheared across their axes, by length.
  type :: plane_cattaneo_t
    !> Coefficient of friction mu, above 0
    real(wp) :: friction_coefficient = 0.0_wp
    !> Normal load P' [N/m]
    real(wp) :: normal_load = 0.0_wp
    !> Half the width of the contact b [m]
    real(wp) :: half_width = 0.0_wp
  contains
    procedure :: stick_half_width
    procedure :: traction => plane_traction
  end type plane_cattaneo_t

contains

  !> Compute the tangential load mu P at which the spheres slide [N].
  elemental real(wp) function sliding_load(self)
    class(mindlin_t), intent(in) :: self

    sliding_load = self%friction_coefficient*self%normal_load
  end function sliding_load

  !> Compute the rigid shift at which the spheres start to slide, Delta_s = 3 mu P S/(16 a) [m].
  elemental real(wp) function sliding_shift(self)
    class(mindlin_t), intent(in) :: self

    sliding_shift = 3.0_wp*self%sliding_load()*self%compliance/(16.0_wp*self%contact_radius)
  end function sliding_shift

  !> Compute the radius of the stick circle under the first loading to Q: c = a (1 - Q/mu P)^(1/3) [m].
  elemental real(wp) function stick_radius(self, load)
    class(mindlin_t), intent(in) :: self
    !> Q [N]
    real(wp), intent(in) :: load

    stick_radius = self%contact_radius*reserve(load, self%sliding_load())**(1.0_wp/3.0_wp)
  end function stick_radius

  !> Compute the rigid shift under the first loading to Q: Delta_s [1 - (1 - Q/mu P)^(2/3)] [m].
  elemental real(wp) function shift(self, load)
    class(mindlin_t), intent(in) :: self
    !> Q [N]
    real(wp), intent(in) :: load

    shift = sign(self%sliding_shift(), load)*(1.0_wp - reserve(load, self%sliding_load())**(2.0_wp/3.0_wp))
  end function shift

  !> Compute the tangential load under a first prescribed shift: mu P [1 - (1 - Delta/Delta_s)^(3/2)] [N].
  elemental real(wp) function load(self, shift)
    class(mindlin_t), intent(in) :: self
    !> Delta [m]
    real(wp), intent(in) :: shift

    load = sign(self%sliding_load(), shift)*(1.0_wp - max(1.0_wp - abs(shift)/self%sliding_shift(), 0.0_wp)**1.5_wp)
  end function load

  !> Compute the shear traction under the first loading to Q [Pa]: semi-ellipsoids of the curvature of mu p over the contact
  !> and, with the opposite sign, over the stick circle.
  elemental real(wp) function traction(self, r, load)
    class(mindlin_t), intent(in) :: self
    !> Distance from the axis [m]
    real(wp), intent(in) :: r
    !> Q [N]
    real(wp), intent(in) :: load

    traction = semicircles(self%contact_radius, self%stick_radius(load), r)
    traction = sign(1.5_wp*self%sliding_load()/(pi*self%contact_radius**3), load)*traction
  end function traction

  !> Compute the rigid shift at Q on the way back from the load Q* > 0 towards -Q*, P constant [m].
  elemental real(wp) function shift_unloading(self, load, peak) result(shift)
    class(mindlin_t), intent(in) :: self
    !> Q and Q* [N]
    real(wp), intent(in) :: load, peak

    shift = self%shift(peak) - 2.0_wp*self%shift(0.5_wp*(peak - load))
  end function shift_unloading

  !> Compute the shear traction at Q on the way back from Q* > 0: slip reversed at the rim [Pa].
  elemental real(wp) function traction_unloading(self, r, load, peak) result(traction)
    class(mindlin_t), intent(in) :: self
    !> Distance from the axis [m]
    real(wp), intent(in) :: r
    !> Q and Q* [N]
    real(wp), intent(in) :: load, peak

    traction = self%traction(r, peak) - 2.0_wp*self%traction(r, 0.5_wp*(peak - load))
  end function traction_unloading

  !> Compute the energy dissipated in one cycle between +Q* and -Q* at constant P [J].
  elemental real(wp) function energy_per_cycle(self, peak) result(energy)
    class(mindlin_t), intent(in) :: self
    !> Q* [N]
    real(wp), intent(in) :: peak

    real(wp) :: f

    f = peak/self%sliding_load()
    energy = 4.8_wp*self%sliding_load()*self%sliding_shift() &
             *(1.0_wp - (1.0_wp - f)**(5.0_wp/3.0_wp) - 5.0_wp/6.0_wp*f*(1.0_wp + (1.0_wp - f)**(2.0_wp/3.0_wp)))
  end function energy_per_cycle

  !> Compute half the width of the stick strip under Q': c = b sqrt(1 - Q'/mu P') [m].
  elemental real(wp) function stick_half_width(self, load)
    class(plane_cattaneo_t), intent(in) :: self
    !> Q' [N/m]
    real(wp), intent(in) :: load

    stick_half_width = self%half_width*sqrt(reserve(load, self%friction_coefficient*self%normal_load))
  end function stick_half_width

  !> Compute the shear traction under a first loading to Q' [Pa].
  elemental real(wp) function plane_traction(self, x, load) result(traction)
    class(plane_cattaneo_t), intent(in) :: self
    !> Distance from the middle [m]
    real(wp), intent(in) :: x
    !> Q' [N/m]
    real(wp), intent(in) :: load

    traction = semicircles(self%half_width, self%stick_half_width(load), x)
    traction = sign(2.0_wp*self%friction_coefficient*self%normal_load/(pi*self%half_width**2), load)*traction
  end function plane_traction

  !> Compute 1 - |Q|/(mu P); not a number beyond sliding.
  elemental real(wp) function reserve(load, sliding)
    !> Q and mu P [N or N/m]
    real(wp), intent(in) :: load, sliding

    reserve = 1.0_wp - abs(load)/sliding
    if (reserve < 0.0_wp) reserve = ieee_value(reserve, ieee_quiet_nan)
  end function reserve

  !> Compute sqrt(a^2 - x^2) - sqrt(c^2 - x^2), each 0 outside.
  elemental real(wp) function semicircles(a, c, x)
    !> Half the width of the contact and of the stick zone, distance from the middle [m]
    real(wp), intent(in) :: a, c, x

    semicircles = sqrt(max(a**2 - x**2, 0.0_wp)) - sqrt(max(c**2 - x**2, 0.0_wp))
  end function semicircles

  !> Find the turning points of a load history that still act on a contact of constant size; the last one is the present load.
  !>
  !> A contact in partial slip follows Masing's rules: a new slip zone that has grown as large as an older one
  !> wipes out the memory of it.
  pure subroutine turning_points(loads, turns, n_turn)
    !> Loads in order, monotone in between; the history begins at 0
    real(wp), intent(in) :: loads(:)
    !> Turning points
    real(wp), intent(out) :: turns(size(loads))
    !> Their number
    integer, intent(out) :: n_turn

    real(wp) :: path(0:size(loads) + 1)
    integer :: i, last

    path = 0.0_wp
    last = 0
    do i = 1, size(loads)
      if (last == 0) then
        last = 1
      else if ((loads(i) - path(last))*(path(last) - path(last - 1)) < 0.0_wp) then
        last = last + 1
      end if
      path(last) = loads(i)
      do while (last > 2)
        if (abs(path(last) - path(last - 1)) < abs(path(last - 1) - path(last - 2))) exit
        path(last - 2) = path(last)
        last = last - 2
      end do
      if (last == 2) then
        ! back on the first loading, or its mirror image
        if (abs(path(2)) >= abs(path(1))) then
          path(1) = path(2)
          last = 1
        end if
      end if
    end do
    turns = path(1:size(loads))
    n_turn = last
  end subroutine turning_points

end module hc_partial_slip
