!> Displacement and stress at a depth of a body by a pyramid of traction, as a sum over depths of its potentials.
!>
!> In a half-space there is one depth, that of the point. A coated body also has a sum of images (hc_image_fit),
!> the difference of the responses at the depth and those of a half-space of the material there:
!>
!>     f(k, z) = f_half-space(k, z) + sum_j c_j exp(-k z_j),
!>
!> whose terms are derivatives of the potentials at the depths z_j.
!>
!> Equations: docs/theory/interior.md, (I2), (I3); docs/theory/coatings.md, (J8), (J9).
module hc_depth_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  use hc_image_fit, only: images_t, wave_numbers
  use hc_layer_response, only: layer_t, layered_body_t, n_wave, ll_p, tt_p, zz_p, lz_p, ll_q, tt_q, zz_q, lz_q, tz_t, lt_t, &
                               uz_p, ul_p, uz_q, ul_q, ut_t
  use hc_interior_pyramid, only: interior_pyramid_t
  use hc_interior_fields, only: n_derivative, stresses, displacements, xx, yy, zz, xy, yz, xz, psi, psi_z, psi_x, psi_y, &
                                chi_x, chi_y, chi_xx, chi_xy, chi_yy, omega_xx, omega_xy, omega_yy, omega_xxx, omega_xxy, &
                                omega_xyy, omega_yyy
  implicit none
  private

  public :: depth_fields_t, new_depth_fields, half_space_of, check_inside

  !> Largest depths of images over that from which waves come back, which are tried until the fit is good enough.
  real(wp), parameter :: deepest(6) = [24.0_wp, 60.0_wp, 150.0_wp, 400.0_wp, 1000.0_wp, 3000.0_wp]
  !> Errors of the fit over the largest response: good enough; too large.
  real(wp), parameter :: good = 1.0e-7_wp, largest_error = 1.0e-5_wp
  !> Wave numbers at which the error of the fit is measured.
  integer, parameter :: n_check = 721

  !> The fields at one depth.
  type :: depth_fields_t
    !> Poisson's ratio there; shear modulus to which displacements refer, that of the surface [Pa], and over that there
    real(wp) :: poisson_ratio = 0.0_wp, shear_modulus = 1.0_wp, stiffness = 1.0_wp
    !> Depths of the potentials, first those of half-spaces [m], and weights of these
    real(wp), allocatable :: depth(:), weight(:)
    !> Coefficients of the images by field and depth, zero at those of half-spaces
    real(wp), allocatable :: image(:, :)
    !> Largest error of the images over the largest response
    real(wp) :: error = 0.0_wp
  contains
    !> Displacement times the shear modulus, and stress, by a pyramid at some points; by many at one point
    procedure :: of_pyramid, of_nodes
    procedure, private :: add
  end type depth_fields_t

contains

  !> Return a body without layers.
  pure type(layered_body_t) function half_space_of(poisson_ratio) result(body)
    real(wp), intent(in) :: poisson_ratio

    allocate (body%layer(0))
    body%base = layer_t(0.0_wp, 1.0_wp, poisson_ratio)
  end function half_space_of

  !> Refuse a body whose constants no body has, and points below the layers of a rigid one.
  pure subroutine check_inside(body, depth, error)
    type(layered_body_t), intent(in) :: body
    !> Depths of points [m]
    real(wp), intent(in) :: depth(:)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: numbers(3, size(body%layer))

    numbers(1, :) = body%layer%thickness
    numbers(2, :) = body%layer%shear_modulus
    numbers(3, :) = body%layer%poisson_ratio
    if (.not. (all(ieee_is_finite(numbers)) .and. ieee_is_finite(body%base%shear_modulus))) then
      call raise(error, status%invalid_input, 'the layers of a body: finite numbers expected')
    else if (any(numbers(:2, :) <= 0.0_wp) .or. any(numbers(3, :) <= -1.0_wp) .or. any(numbers(3, :) > 0.5_wp) &
             .or. body%base%shear_modulus < 0.0_wp) then
      call raise(error, status%invalid_input, 'the layers of a body: positive thicknesses and moduli expected')
    else if (.not. body%base%shear_modulus > 0.0_wp .and. any(depth > sum(numbers(1, :)))) then
      call raise(error, status%invalid_input, &
                 'field points: depths inside the layers expected, as the body below them is rigid and has no stress')
    end if
  end subroutine check_inside

  !> Set up the fields at a depth.
  pure subroutine new_depth_fields(self, body, z, error)
    !> Fields to be set up
    type(depth_fields_t), intent(out) :: self
    !> The body
    type(layered_body_t), intent(in) :: body
    !> Depth [m]
    real(wp), intent(in) :: z
    !> Allocated on failure: layers that images do not describe
    type(error_t), allocatable, intent(out) :: error
    type(layer_t) :: surface, here

    surface = body%material_at(0.0_wp)
    here = body%material_at(z)
    self%poisson_ratio = here%poisson_ratio
    self%shear_modulus = surface%shear_modulus
    self%stiffness = surface%shear_modulus/here%shear_modulus
    self%depth = [z]
    self%weight = [1.0_wp]
    if (size(body%layer) > 0) then
      call find_images(self, body, here, z, error)
    else
      allocate (self%image(n_wave, 1), source=0.0_wp)
    end if
  end subroutine new_depth_fields

  !> Find the images of a coated body.
  pure subroutine find_images(self, body, material, z, error)
    type(depth_fields_t), intent(inout) :: self
    type(layered_body_t), intent(in) :: body
    !> Material at the depth
    type(layer_t), intent(in) :: material
    !> Depth [m]
    real(wp), intent(in) :: z
    !> Allocated on failure: the error is too large
    type(error_t), allocatable, intent(out) :: error
    type(layered_body_t) :: half
    type(images_t) :: images
    real(wp) :: found(0:n_check, n_wave), size_of(0:n_check), k(n_check), back, whole
    character(len=16) :: number
    integer :: i, trial

    allocate (half%layer(0))
    half%base = material
    ! waves come back from the base of the outermost layer, or have come down to the depth
    back = max(z, 2.0_wp*body%layer(1)%thickness - z)
    whole = max(back, sum(body%layer%thickness))
    do trial = 1, size(deepest)
      k = wave_numbers(back, whole, deepest(trial), n_check)
      ! the shortest of all stands for k = 0
      do i = 0, n_check
        associate (wave => merge(1.0e-3_wp*k(1), k(max(i, 1)), i == 0))
          found(i, :) = body%at_depth(wave, z)
          size_of(i) = max(1.0_wp, maxval(abs(found(i, :tz_t))), self%shear_modulus*maxval(found(i, uz_p:)))
          found(i, :) = found(i, :) - half%at_depth(wave, z)
          found(i, uz_p:) = self%shear_modulus*found(i, uz_p:)
        end associate
      end do
      call images%improve(back, whole, deepest(trial), k, found, size_of)
      if (images%error <= good) exit
    end do
    self%error = images%error
    if (allocated(images%depth)) then
      self%depth = [z, images%depth]
      self%weight = [1.0_wp, 0.0_wp*images%depth]
      self%image = reshape([spread(0.0_wp, 1, n_wave), images%coefficient], [n_wave, size(images%depth) + 1])
    end if
    if (self%error <= largest_error) return
    write (number, '(es8.1)') self%error
    call raise(error, status%invalid_input, 'the stress in a coated body: its sum of images has an error of '// &
               trim(adjustl(number))//' of the largest one; at most 1e-5 expected, so ratios of moduli nearer to 1')
  end subroutine find_images

  !> Compute displacement times the shear modulus, and stress, by unit peak tractions of a pyramid.
  pure subroutine of_pyramid(self, pyramid, spacing, x, y, displacement, stress)
    class(depth_fields_t), intent(in) :: self
    type(interior_pyramid_t), intent(in) :: pyramid
    !> Longest edge [m]
    real(wp), intent(in) :: spacing
    !> Points relative to the node, at most most_points, in longest edges
    real(wp), intent(in), contiguous :: x(:), y(:)
    !> Point; direction x, y, z or component; load. Lengths are over the spacing
    real(wp), intent(out), contiguous :: displacement(:, :, :), stress(:, :, :)
    real(wp) :: d(size(x), n_derivative), z(size(x))
    integer :: j

    displacement = 0.0_wp
    stress = 0.0_wp
    do j = 1, size(self%depth)
      z = self%depth(j)/spacing
      call pyramid%potentials(size(x), x, y, z, d)
      call self%add(j, d, d, d, spacing, displacement, stress)
    end do
  end subroutine of_pyramid

  !> Compute displacement times the shear modulus, and stress, by the tractions of many nodes at a point for a history of steps.
  pure subroutine of_nodes(self, pyramid, x, y, load, sums, displacement, stress)
    class(depth_fields_t), intent(in) :: self
    !> Pyramid of one of them
    type(interior_pyramid_t), intent(in) :: pyramid
    !> The point relative to the nodes, in longest edges
    real(wp), intent(in) :: x(:), y(:)
    !> Tractions (node, component of the steps one after the other) [Pa]
    real(wp), intent(in) :: load(:, :)
    !> Memory for derivatives of the potentials (derivative, load)
    real(wp), intent(out), contiguous :: sums(:, :)
    !> Displacement (direction, step) [Pa m] and stress (component, step) [Pa]
    real(wp), intent(out) :: displacement(:, :), stress(:, :)
    real(wp) :: u(1, 3, 3), s(1, 6, 3), d(1, n_derivative, 3)
    integer :: j, step

    displacement = 0.0_wp
    stress = 0.0_wp
    associate (spacing => pyramid%spacing)
      do j = 1, size(self%depth)
        call pyramid%sum_over_nodes(x, y, self%depth(j)/spacing, load, sums)
        do step = 1, size(stress, 2)
          d(1, :, :) = sums(:, 3*step - 2:3*step)
          u = 0.0_wp
          s = 0.0_wp
          call self%add(j, d(:, :, 1), d(:, :, 2), d(:, :, 3), spacing, u, s)
          displacement(:, step) = displacement(:, step) + spacing*sum(u(1, :, :), dim=2)
          stress(:, step) = stress(:, step) + sum(s(1, :, :), dim=2)
        end do
      end do
    end associate
  end subroutine of_nodes

  !> Add displacement times the shear modulus, and stress, by the potentials of the three loads at one of the depths.
  pure subroutine add(self, j, p, q_x, q_y, spacing, displacement, stress)
    class(depth_fields_t), intent(in) :: self
    !> Number of the depth
    integer, intent(in) :: j
    !> Derivatives for the pressure, and for the traction along x and y that acts on the body (point, derivative)
    real(wp), intent(in), contiguous :: p(:, :), q_x(:, :), q_y(:, :)
    !> Length that those refer to [m]
    real(wp), intent(in) :: spacing
    !> Point; direction x, y, z or component; load. Lengths are over the spacing
    real(wp), intent(inout), contiguous :: displacement(:, :, :), stress(:, :, :)
    real(wp) :: u(size(p, 1), 3, 3), s(size(p, 1), 6, 3), z(size(p, 1))

    if (abs(self%weight(j)) > 0.0_wp) then
      z = self%depth(j)/spacing
      call displacements(size(z), p, q_x, q_y, z, self%poisson_ratio, u)
      call stresses(size(z), p, q_x, q_y, self%poisson_ratio, s)
      displacement = displacement + self%weight(j)*self%stiffness*u
      stress = stress + self%weight(j)*s
    else
      call add_image(self%image(:, j)/(2.0_wp*pi), p, q_x, q_y, displacement, stress)
    end if
  end subroutine add

  !> Add the fields of an image, (J9).
  pure subroutine add_image(c, p, q_x, q_y, u, s)
    !> Coefficients over 2 pi
    real(wp), intent(in) :: c(n_wave)
    !> Derivatives by load
    real(wp), intent(in) :: p(:, :), q_x(:, :), q_y(:, :)
    !> Displacement and stress
    real(wp), intent(inout) :: u(:, :, :), s(:, :, :)

    u(:, 1, 1) = u(:, 1, 1) - c(ul_p)*p(:, chi_x)
    u(:, 2, 1) = u(:, 2, 1) - c(ul_p)*p(:, chi_y)
    u(:, 3, 1) = u(:, 3, 1) + c(uz_p)*p(:, psi)
    u(:, 1, 2) = u(:, 1, 2) - c(ul_q)*q_x(:, omega_xx) - c(ut_t)*q_x(:, omega_yy)
    u(:, 2, 2) = u(:, 2, 2) - (c(ul_q) - c(ut_t))*q_x(:, omega_xy)
    u(:, 3, 2) = u(:, 3, 2) - c(uz_q)*q_x(:, chi_x)
    u(:, 1, 3) = u(:, 1, 3) - (c(ul_q) - c(ut_t))*q_y(:, omega_xy)
    u(:, 2, 3) = u(:, 2, 3) - c(ul_q)*q_y(:, omega_yy) - c(ut_t)*q_y(:, omega_xx)
    u(:, 3, 3) = u(:, 3, 3) - c(uz_q)*q_y(:, chi_y)

    s(:, xx, 1) = s(:, xx, 1) + c(ll_p)*p(:, chi_xx) + c(tt_p)*p(:, chi_yy)
    s(:, yy, 1) = s(:, yy, 1) + c(ll_p)*p(:, chi_yy) + c(tt_p)*p(:, chi_xx)
    s(:, xy, 1) = s(:, xy, 1) + (c(ll_p) - c(tt_p))*p(:, chi_xy)
    s(:, zz, 1) = s(:, zz, 1) - c(zz_p)*p(:, psi_z)
    s(:, xz, 1) = s(:, xz, 1) + c(lz_p)*p(:, psi_x)
    s(:, yz, 1) = s(:, yz, 1) + c(lz_p)*p(:, psi_y)

    associate (lll => c(tt_q) - c(ll_q) + 2.0_wp*c(lt_t), tt => c(tt_q), lt => c(lt_t))
      s(:, xx, 2) = s(:, xx, 2) + lll*q_x(:, omega_xxx) + (tt + 2.0_wp*lt)*q_x(:, psi_x)
      s(:, yy, 2) = s(:, yy, 2) + lll*q_x(:, omega_xyy) + tt*q_x(:, psi_x)
      s(:, xy, 2) = s(:, xy, 2) + lll*q_x(:, omega_xxy) + lt*q_x(:, psi_y)
      s(:, xx, 3) = s(:, xx, 3) + lll*q_y(:, omega_xxy) + tt*q_y(:, psi_y)
      s(:, yy, 3) = s(:, yy, 3) + lll*q_y(:, omega_yyy) + (tt + 2.0_wp*lt)*q_y(:, psi_y)
      s(:, xy, 3) = s(:, xy, 3) + lll*q_y(:, omega_xyy) + lt*q_y(:, psi_x)
    end associate
    s(:, zz, 2) = s(:, zz, 2) + c(zz_q)*q_x(:, psi_x)
    s(:, zz, 3) = s(:, zz, 3) + c(zz_q)*q_y(:, psi_y)
    s(:, xz, 2) = s(:, xz, 2) + c(lz_q)*q_x(:, chi_xx) + c(tz_t)*q_x(:, chi_yy)
    s(:, yz, 2) = s(:, yz, 2) + (c(lz_q) - c(tz_t))*q_x(:, chi_xy)
    s(:, xz, 3) = s(:, xz, 3) + (c(lz_q) - c(tz_t))*q_y(:, chi_xy)
    s(:, yz, 3) = s(:, yz, 3) + c(lz_q)*q_y(:, chi_yy) + c(tz_t)*q_y(:, chi_xx)
  end subroutine add_image

end module hc_depth_fields
