!> Two elastic bodies reduced to the three constants that matter in contact.
!>
!> For bodies with shear moduli G and Poisson's ratios nu (sums over both):
!>
!>     lambda_1 = sum (1 - nu)/(2 pi G) = 1/(pi E*)
!>     lambda_2 = (1 - 2 nu_1)/(4 pi G_1) - (1 - 2 nu_2)/(4 pi G_2) = beta lambda_1
!>     lambda_5 = sum nu/(2 pi G) = gamma lambda_1
!>
!> Three numbers describe any pair exactly: no averaged Poisson's ratio (Table
!> 8.2) is needed. beta is Dundurs' second constant.
!>
!> Equations: docs/theory/elasticity.md, (E14) to (E16).
module hc_elastic_pair
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status, raise
  implicit none
  private

  public :: material_t, elastic_pair_t, new_elastic_pair, check_pair, find_bulk_strain

  !> An isotropic elastic or a rigid material.
  type :: material_t
    !> Young's modulus [Pa]
    real(wp) :: young_modulus = 0.0_wp
    !> Poisson's ratio
    real(wp) :: poisson_ratio = 0.0_wp
    !> A rigid body: the two constants above are not used
    logical :: rigid = .false.
  end type material_t

  !> Compliance constants of a pair of bodies.
  type :: elastic_pair_t
    !> Normal compliance, 1/(pi E*) [1/Pa]
    real(wp) :: lambda_1 = 0.0_wp
    !> Coupling of normal and tangential displacements [1/Pa]
    real(wp) :: lambda_2 = 0.0_wp
    !> Extra tangential compliance [1/Pa]
    real(wp) :: lambda_5 = 0.0_wp
    !> Displacement that springs between the bodies give way by under a unit shear traction, 1/k_T [m/Pa]
    real(wp) :: tangential_layer = 0.0_wp
  contains
    !> Effective modulus E* [Pa]
    procedure :: effective_modulus
    !> Dundurs' constant beta
    procedure :: beta => dundurs_beta
    !> lambda_5/lambda_1
    procedure :: gamma => tangential_gamma
    !> The constants over lambda_1
    procedure :: scaled
  end type elastic_pair_t

contains

  !> Compute the compliance constants of two bodies.
  pure subroutine new_elastic_pair(pair, body_1, body_2, error)
    !> Pair to be set up
    type(elastic_pair_t), intent(out) :: pair
    !> Material of body 1 (z > 0) and of body 2 (z < 0)
    type(material_t), intent(in) :: body_1, body_2
    !> Allocated on failure: a modulus that is not positive, a Poisson's ratio
    !> outside (-1, 0.5], two rigid bodies
    type(error_t), allocatable, intent(out) :: error

    call check(body_1, 'body 1', error)
    if (allocated(error)) return
    call check(body_2, 'body 2', error)
    if (allocated(error)) return
    if (body_1%rigid .and. body_2%rigid) then
      call raise(error, status%invalid_input, 'both bodies are rigid: at least one elastic body expected')
      return
    end if
    pair%lambda_1 = normal(body_1) + normal(body_2)
    pair%lambda_2 = coupling(body_1) - coupling(body_2)
    pair%lambda_5 = tangential(body_1) + tangential(body_2)
  end subroutine new_elastic_pair

  !> Refuse constants that no two elastic bodies have, which new_elastic_pair never sets.
  pure subroutine check_pair(pair, error)
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair
    !> Allocated on failure: the bodies would gain energy as they deform
    type(error_t), allocatable, intent(out) :: error
    logical :: sound

    sound = all(ieee_is_finite([pair%lambda_1, pair%lambda_2, pair%lambda_5]))
    if (sound) sound = pair%lambda_1 > 0.0_wp .and. abs(pair%lambda_2) < pair%lambda_1 .and. pair%lambda_5 > -pair%lambda_1
    if (sound) sound = ieee_is_finite(pair%tangential_layer)
    if (sound) then
      if (pair%tangential_layer >= 0.0_wp) return
      call raise(error, status%invalid_input, 'tangential stiffness of the interface: a positive number expected')
      return
    end if
    call raise(error, status%invalid_input, 'the elastic constants of the pair: finite numbers with '// &
               'lambda_1 > 0, |lambda_2| < lambda_1 and lambda_5 > -lambda_1 expected')
  end subroutine check_pair

  !> Refuse elastic constants of a body that make no sense.
  pure subroutine check(body, name, error)
    type(material_t), intent(in) :: body
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error

    if (body%rigid) return
    ! finite first: a comparison with NaN may be trapped
    if (.not. all(ieee_is_finite([body%young_modulus, body%poisson_ratio]))) then
      call raise(error, status%invalid_input, 'the elastic constants of '//name//': finite numbers expected')
    else if (body%young_modulus <= 0.0_wp) then
      call raise(error, status%invalid_input, 'Young''s modulus of '//name//': a positive number expected')
    else if (body%poisson_ratio <= -1.0_wp .or. body%poisson_ratio > 0.5_wp) then
      call raise(error, status%invalid_input, &
                 'Poisson''s ratio of '//name//': a number above -1 and at most 0.5 expected')
    end if
  end subroutine check

  !> Find the strain of a bulk stress in the plane of the surface by Hooke's law, and the stress of a direction without strain.
  pure subroutine find_bulk_strain(body, plane_strain, stress, strain)
    !> Material of an elastic body
    type(material_t), intent(in) :: body
    !> 0: free sides (plane stress); 1, 2: no strain along x, along y
    integer, intent(in) :: plane_strain
    !> xx, yy, xy, tension positive; that along the direction without strain is set [Pa]
    real(wp), intent(inout) :: stress(3)
    !> xx, yy, xy
    real(wp), intent(out) :: strain(3)

    associate (nu => body%poisson_ratio)
      if (plane_strain == 1) stress(1) = nu*stress(2)
      if (plane_strain == 2) stress(2) = nu*stress(1)
      strain = [stress(1) - nu*stress(2), stress(2) - nu*stress(1), (1.0_wp + nu)*stress(3)]/body%young_modulus
      if (plane_strain /= 0) strain(plane_strain) = 0.0_wp ! without rounding errors
    end associate
  end subroutine find_bulk_strain

  !> Compute (1 - nu)/(2 pi G)
  elemental real(wp) function normal(body)
    type(material_t), intent(in) :: body
    normal = 0.0_wp
    if (.not. body%rigid) normal = (1.0_wp - body%poisson_ratio)/(2.0_wp*pi*shear_modulus(body))
  end function normal

  !> Compute (1 - 2 nu)/(4 pi G)
  elemental real(wp) function coupling(body)
    type(material_t), intent(in) :: body
    coupling = 0.0_wp
    if (.not. body%rigid) coupling = (1.0_wp - 2.0_wp*body%poisson_ratio)/(4.0_wp*pi*shear_modulus(body))
  end function coupling

  !> Compute nu/(2 pi G)
  elemental real(wp) function tangential(body)
    type(material_t), intent(in) :: body
    tangential = 0.0_wp
    if (.not. body%rigid) tangential = body%poisson_ratio/(2.0_wp*pi*shear_modulus(body))
  end function tangential

  !> Return the shear modulus [Pa]
  elemental real(wp) function shear_modulus(body)
    type(material_t), intent(in) :: body
    shear_modulus = body%young_modulus/(2.0_wp*(1.0_wp + body%poisson_ratio))
  end function shear_modulus

  !> Return E* [Pa]
  elemental real(wp) function effective_modulus(self)
    class(elastic_pair_t), intent(in) :: self
    effective_modulus = 1.0_wp/(pi*self%lambda_1)
  end function effective_modulus

  !> Return Dundurs' beta
  elemental real(wp) function dundurs_beta(self)
    class(elastic_pair_t), intent(in) :: self
    dundurs_beta = self%lambda_2/self%lambda_1
  end function dundurs_beta

  !> Return gamma = lambda_5/lambda_1
  elemental real(wp) function tangential_gamma(self)
    class(elastic_pair_t), intent(in) :: self
    tangential_gamma = self%lambda_5/self%lambda_1
  end function tangential_gamma

  !> Return the pair over its lambda_1.
  pure type(elastic_pair_t) function scaled(self)
    class(elastic_pair_t), intent(in) :: self
    scaled = elastic_pair_t(1.0_wp, self%beta(), self%gamma())
  end function scaled

end module hc_elastic_pair
