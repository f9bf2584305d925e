!> Surface displacements of an elastic half-space below layers, or of layers on a rigid base, by waves of traction.
!>
!> Under tractions exp(i k.X) the displacements along the normal (z), along k (L) and across k in the plane (T) are
!>
!>     u_z = C_zz p + i D q_L        u_L = -i D p + C_LL q_L        u_T = C_TT q_T
!>
!> with real C and D. One layer has closed forms (T.C. O'Sullivan, R.B. King, J. Tribology 110, 1988, for C_zz). Several layers
!> are added one by one from the bottom: the 2 x 2 compliance below a layer becomes the one below its surface,
!> with exponentials that only decay. The amplitudes in each layer, from the top down, give displacement and stress at any depth.
!>
!> Equations: docs/theory/coatings.md, (J1) to (J4), (J8).
module hc_layer_response
  use hc_precision, only: wp, pi
  implicit none
  private

  public :: layer_t, layered_body_t, n_response, of_normal, of_along, of_across, of_coupling

  !> Responses: k/(2 pi) times C_zz, C_LL, C_TT and -D [1/Pa]. On a half-space they do not depend on k.
  integer, parameter :: n_response = 4, of_normal = 1, of_along = 2, of_across = 3, of_coupling = 4

  !> Fields at a depth, over i where they are odd in k: stresses LL, TT, zz, Lz by the pressure, then by q_L, ...
  integer, parameter, public :: ll_p = 1, tt_p = 2, zz_p = 3, lz_p = 4, ll_q = 5, tt_q = 6, zz_q = 7, lz_q = 8
  !> ... Tz and LT by q_T, and k times the displacements z, L by the pressure and by q_L, T by q_T [1/Pa].
  integer, parameter, public :: tz_t = 9, lt_t = 10, uz_p = 11, ul_p = 12, uz_q = 13, ul_q = 14, ut_t = 15, n_wave = 15

  !> Wave number times thickness from which nothing below the layer is seen, in any digit.
  real(wp), parameter :: shortest = 100.0_wp

  !> A layer.
  type :: layer_t
    !> Thickness [m]
    real(wp) :: thickness = 0.0_wp
    !> Shear modulus [Pa] and Poisson's ratio
    real(wp) :: shear_modulus = 0.0_wp, poisson_ratio = 0.0_wp
  end type layer_t

  !> A body with layers, or with none.
  type :: layered_body_t
    !> The layers, outermost first
    type(layer_t), allocatable :: layer(:)
    !> The half-space below; its shear modulus is 0 if it is rigid
    type(layer_t) :: base
  contains
    !> Responses to waves of traction
    procedure :: response
    !> Stresses and displacements at a depth under waves of traction, the number of the layer there, and its material
    procedure :: at_depth, layer_at, material_at
    !> Displacements by a uniform pressure and by a uniform shear traction over their values, on a rigid base
    procedure :: uniform
  end type layered_body_t

contains

  !> Compute the responses at a wave number.
  pure function response(self, k) result(f)
    class(layered_body_t), intent(in) :: self
    !> Wave number [1/m]
    real(wp), intent(in) :: k
    real(wp) :: f(n_response)
    real(wp) :: c(2, 2), s
    integer :: i

    if (size(self%layer) == 0) then
      f = half_space(self%base)
    else if (size(self%layer) == 1) then
      f = one_layer(self%layer(1), self%base, min(k*self%layer(1)%thickness, shortest))
    else
      f = half_space(self%base)
      c = reshape([f(of_along), f(of_coupling), f(of_coupling), f(of_normal)], [2, 2])
      s = f(of_across)
      do i = size(self%layer), 1, -1
        call add_layer(self%layer(i), min(k*self%layer(i)%thickness, shortest), c, s)
      end do
      f = [c(2, 2), c(1, 1), s, 0.5_wp*(c(1, 2) + c(2, 1))]
    end if
    f = f/(2.0_wp*pi)
  end function response

  !> Compute k times C_zz, C_LL, C_TT and -D of a half-space [1/Pa].
  pure function half_space(base) result(f)
    type(layer_t), intent(in) :: base
    real(wp) :: f(n_response)

    f = 0.0_wp
    associate (g => base%shear_modulus, nu => base%poisson_ratio)
      if (g > 0.0_wp) f = [1.0_wp - nu, 1.0_wp - nu, 1.0_wp, 0.5_wp - nu]/g
    end associate
  end function half_space

  !> Compute k times C_zz, C_LL, C_TT and -D of one layer on a half-space [1/Pa], (J2).
  pure function one_layer(layer, base, x) result(f)
    type(layer_t), intent(in) :: layer, base
    !> Wave number times thickness
    real(wp), intent(in) :: x
    real(wp) :: f(n_response)
    real(wp) :: m, ratio, lambda, kappa, chi, both, theta, whole, bend, denominator

    associate (g => layer%shear_modulus, nu => layer%poisson_ratio)
      m = 3.0_wp - 4.0_wp*nu
      lambda = -m
      kappa = -1.0_wp/m
      chi = -1.0_wp
      both = 1.0_wp
      if (base%shear_modulus > 0.0_wp) then
        ratio = g/base%shear_modulus
        lambda = 1.0_wp - 4.0_wp*(1.0_wp - nu)/(1.0_wp + ratio*(3.0_wp - 4.0_wp*base%poisson_ratio))
        kappa = (ratio - 1.0_wp)/(ratio + m)
        chi = (ratio - 1.0_wp)/(ratio + 1.0_wp)
        both = lambda*kappa
      end if
      theta = exp(-2.0_wp*x)
      bend = 4.0_wp*kappa*x*theta
      ! 1 - lambda kappa theta^2, without the loss of digits where both terms are 1
      whole = (1.0_wp - both) - both*expm1(-4.0_wp*x)
      denominator = 1.0_wp - (lambda + kappa + 4.0_wp*kappa*x*x)*theta + both*theta*theta
      f(of_normal) = (1.0_wp - nu)*(whole + bend)/denominator
      f(of_along) = (1.0_wp - nu)*(whole - bend)/denominator
      f(of_across) = (1.0_wp + chi*theta)/(1.0_wp - chi*theta)
      f(of_coupling) = 0.5_wp*((1.0_wp - 2.0_wp*nu)*(1.0_wp + both*theta*theta) &
                               + (lambda - m*kappa + 4.0_wp*kappa*x*x)*theta)/denominator
      f = f/g
    end associate
  end function one_layer

  !> Compute exp(x) - 1 without loss of digits, x <= 0.
  elemental real(wp) function expm1(x)
    real(wp), intent(in) :: x

    expm1 = exp(x) - 1.0_wp
    if (x > -1.0_wp) expm1 = 2.0_wp*exp(0.5_wp*x)*sinh(0.5_wp*x)
  end function expm1

  !> Replace the compliance below a layer by the compliance below its surface, (J3) and (J4).
  pure subroutine add_layer(layer, x, c, s)
    type(layer_t), intent(in) :: layer
    !> Wave number times thickness
    real(wp), intent(in) :: x
    !> k times the compliance in the plane of k and z (L, z), and across [1/Pa]
    real(wp), intent(inout) :: c(2, 2), s
    real(wp), dimension(2, 2) :: up, up_force, down, down_force, amplitude
    real(wp) :: r

    amplitude = reflection(layer, x, c)
    ! at its top
    up = rising(layer, -x)
    up_force = rising_force(layer, -x)
    down = falling(layer, 0.0_wp) + matmul(up, amplitude)
    down_force = inverse(falling_force(layer, 0.0_wp) + matmul(up_force, amplitude))
    c = matmul(down, down_force)
    associate (g => layer%shear_modulus)
      r = (g*s - 1.0_wp)/(g*s + 1.0_wp)*exp(-2.0_wp*x)
      s = (1.0_wp + r)/((1.0_wp - r)*g)
    end associate
  end subroutine add_layer

  !> Compute the amplitudes of rising solutions by those of falling ones.
  pure function reflection(layer, x, c) result(r)
    type(layer_t), intent(in) :: layer
    !> Wave number times thickness, k times the compliance of the part below [1/Pa]
    real(wp), intent(in) :: x, c(2, 2)
    real(wp), dimension(2, 2) :: up, up_force, down, down_force, r

    up = rising(layer, 0.0_wp)
    up_force = rising_force(layer, 0.0_wp)
    down = falling(layer, x)
    down_force = falling_force(layer, x)
    up = inverse(up - matmul(c, up_force))
    down = down - matmul(c, down_force)
    r = -matmul(up, down)
  end function reflection

  !> Return the number of the layer at a depth, that above at an interface; one more than there are: the base.
  pure integer function layer_at(self, z)
    class(layered_body_t), intent(in) :: self
    !> Depth [m]
    real(wp), intent(in) :: z
    real(wp) :: bottom

    bottom = 0.0_wp
    do layer_at = 1, size(self%layer)
      bottom = bottom + self%layer(layer_at)%thickness
      if (z <= bottom) return
    end do
  end function layer_at

  !> Return the material at a depth.
  pure type(layer_t) function material_at(self, z)
    class(layered_body_t), intent(in) :: self
    !> Depth [m]
    real(wp), intent(in) :: z
    integer :: here

    here = self%layer_at(z)
    material_at = self%base
    if (here <= size(self%layer)) material_at = self%layer(here)
  end function material_at

  !> Compute stresses and displacements at a depth under waves of traction, (J8).
  pure function at_depth(self, k, z) result(f)
    class(layered_body_t), intent(in) :: self
    !> Wave number [1/m], and depth [m]
    real(wp), intent(in) :: k, z
    real(wp) :: f(n_wave)
    real(wp), dimension(2, 2) :: force, moved
    real(wp) :: c(2, 2, size(self%layer)), s(size(self%layer)), base(n_response), anti(2), top
    integer :: i, here

    here = self%layer_at(z)
    base = half_space(self%base)
    do i = size(self%layer), 1, -1
      if (i == size(self%layer)) then
        c(:, :, i) = reshape([base(of_along), base(of_coupling), base(of_coupling), base(of_normal)], [2, 2])
        s(i) = base(of_across)
      else
        c(:, :, i) = c(:, :, i + 1)
        s(i) = s(i + 1)
        call add_layer(self%layer(i + 1), k*self%layer(i + 1)%thickness, c(:, :, i), s(i))
      end if
    end do
    force = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    anti(1) = 1.0_wp
    top = 0.0_wp
    do i = 1, here - 1
      call pass(self%layer(i), k*self%layer(i)%thickness, k*self%layer(i)%thickness, c(:, :, i), s(i), force, moved, anti)
      top = top + self%layer(i)%thickness
    end do
    if (here <= size(self%layer)) then
      call pass(self%layer(here), k*self%layer(here)%thickness, k*(z - top), c(:, :, here), s(here), force, moved, anti)
      f = waves_of(self%layer(here), force, moved, anti)
    else
      moved = matmul(inverse(falling_force(self%base, 0.0_wp)), force)
      force = matmul(falling_force(self%base, k*(z - top)), moved)
      moved = matmul(falling(self%base, k*(z - top)), moved)
      anti(1) = anti(1)*exp(-k*(z - top))
      anti(2) = anti(1)/self%base%shear_modulus
      f = waves_of(self%base, force, moved, anti)
    end if
  end function at_depth

  !> Replace forces at the top of a layer by those at a depth in it, and compute k times the displacements there.
  pure subroutine pass(layer, x, depth, c, s, force, moved, anti)
    type(layer_t), intent(in) :: layer
    !> Wave number times thickness, and times depth below the top
    real(wp), intent(in) :: x, depth
    !> k times the compliance of the part below, in the plane of k and z, and across [1/Pa]
    real(wp), intent(in) :: c(2, 2), s
    !> Forces (L, z) by both loads, and displacements [1/Pa]
    real(wp), intent(inout) :: force(2, 2)
    real(wp), intent(out) :: moved(2, 2)
    !> Force and displacement across
    real(wp), intent(inout) :: anti(2)
    real(wp) :: up(2, 2), r

    up = reflection(layer, x, c)
    force = matmul(inverse(falling_force(layer, 0.0_wp) + matmul(rising_force(layer, -x), up)), force)
    moved = matmul(falling(layer, depth) + matmul(rising(layer, depth - x), up), force)
    force = matmul(falling_force(layer, depth) + matmul(rising_force(layer, depth - x), up), force)
    associate (g => layer%shear_modulus)
      r = (g*s - 1.0_wp)/(g*s + 1.0_wp)
      anti(1) = anti(1)/(1.0_wp - r*exp(-2.0_wp*x))
      anti(2) = anti(1)*(exp(-depth) + r*exp(depth - 2.0_wp*x))/g
      anti(1) = anti(1)*(exp(-depth) - r*exp(depth - 2.0_wp*x))
    end associate
  end subroutine pass

  !> Collect the fields from forces on the part below and k times displacements, Hooke's law in the plane strain of k and z.
  pure function waves_of(layer, force, moved, anti) result(f)
    type(layer_t), intent(in) :: layer
    real(wp), intent(in) :: force(2, 2), moved(2, 2), anti(2)
    real(wp) :: f(n_wave), along(2)

    associate (g => layer%shear_modulus, nu => layer%poisson_ratio)
      along = -(2.0_wp*g*moved(1, :) + nu*force(2, :))/(1.0_wp - nu)
      f([ll_p, zz_p, lz_p]) = [along(2), -force(2, 2), -force(1, 2)]
      f([ll_q, zz_q, lz_q]) = [-along(1), force(2, 1), -force(1, 1)]
      f([tt_p, tt_q]) = nu*[along(2) - force(2, 2), force(2, 1) - along(1)]
      f([tz_t, lt_t, ut_t]) = [-anti(1), g*anti(2), anti(2)]
      f([uz_p, ul_p, uz_q, ul_q]) = [moved(2, 2), moved(1, 2), -moved(2, 1), moved(1, 1)]
    end associate
  end function waves_of

  !> Compute the displacements (u_L/i, u_z) of the two solutions that decay with the depth, at x = k z.
  pure function falling(layer, x) result(u)
    type(layer_t), intent(in) :: layer
    real(wp), intent(in) :: x
    real(wp) :: u(2, 2)

    u = exp(-x)*reshape([1.0_wp, -1.0_wp, x, -(3.0_wp - 4.0_wp*layer%poisson_ratio) - x], [2, 2])
  end function falling

  !> Compute their forces on the part below, over k.
  pure function falling_force(layer, x) result(f)
    type(layer_t), intent(in) :: layer
    real(wp), intent(in) :: x
    real(wp) :: f(2, 2)

    associate (nu => layer%poisson_ratio)
      f = 2.0_wp*layer%shear_modulus*exp(-x)*reshape([1.0_wp, -1.0_wp, 1.0_wp - 2.0_wp*nu + x, -2.0_wp + 2.0_wp*nu - x], [2, 2])
    end associate
  end function falling_force

  !> Compute the displacements of the two solutions that grow with the depth, x <= 0 from the bottom.
  pure function rising(layer, x) result(u)
    type(layer_t), intent(in) :: layer
    real(wp), intent(in) :: x
    real(wp) :: u(2, 2)

    u = exp(x)*reshape([1.0_wp, 1.0_wp, -x, 3.0_wp - 4.0_wp*layer%poisson_ratio - x], [2, 2])
  end function rising

  !> Compute their forces on the part below, over k.
  pure function rising_force(layer, x) result(f)
    type(layer_t), intent(in) :: layer
    real(wp), intent(in) :: x
    real(wp) :: f(2, 2)

    associate (nu => layer%poisson_ratio)
      f = -2.0_wp*layer%shear_modulus*exp(x)*reshape([1.0_wp, 1.0_wp, 1.0_wp - 2.0_wp*nu - x, 2.0_wp - 2.0_wp*nu - x], [2, 2])
    end associate
  end function rising_force

  !> Invert a 2 x 2 matrix.
  pure function inverse(a)
    real(wp), intent(in) :: a(2, 2)
    real(wp) :: inverse(2, 2)

    inverse = reshape([a(2, 2), -a(2, 1), -a(1, 2), a(1, 1)], [2, 2])/(a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1))
  end function inverse

  !> Compute the displacement by a uniform pressure and by a uniform shear traction, over their values [m/Pa]; rigid base.
  pure function uniform(self) result(compliance)
    class(layered_body_t), intent(in) :: self
    real(wp) :: compliance(2)
    integer :: i

    compliance = 0.0_wp
    do i = 1, size(self%layer)
      associate (t => self%layer(i)%thickness, g => self%layer(i)%shear_modulus, nu => self%layer(i)%poisson_ratio)
        compliance = compliance + t/g*[(1.0_wp - 2.0_wp*nu)/(2.0_wp*(1.0_wp - nu)), 1.0_wp]
      end associate
    end do
  end function uniform

end module hc_layer_response
